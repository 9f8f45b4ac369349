"""Mapping file of an import: assigns columns of a measurement file to channels of a unit."""

from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, StringConstraints, model_validator

from service.settings.base import Identifier, MisfitError, MissingError, Settings, refuse_twice

ColumnName = Annotated[str, StringConstraints(min_length=1, max_length=500)]
GroupName = Annotated[str, StringConstraints(max_length=500)]
UnitName = Annotated[str, StringConstraints(min_length=1, max_length=40)]
Format = Literal["mdf4", "tdms", "hdf5", "csv", "candump", "blf"]
Form = Literal[
    "iso8601",
    "epoch_s",
    "epoch_ms",
    "epoch_us",
    "epoch_ns",
    "elapsed_s",
    "elapsed_ms",
    "elapsed_us",
    "elapsed_ns",
    "timestamp",
]

CAN_LOGS = ("candump", "blf")
WITH_GROUPS = ("tdms", "mdf4")
WITH_OWN_TIME = ("tdms", "mdf4", *CAN_LOGS)
IN_UTC = ("tdms", "candump")
"""Formats whose time stamps are UTC by definition."""


class TimeSettings(Settings):
    """Settings of the times of the samples in an imported file."""

    source: Literal["file", "column", "start"]
    """Source of the times. "file": time stamps of the format (MDF4 time channel, TDMS waveform
    properties, time stamps of a CAN log). "column": a column of the file. "start": `start` and the
    rate of the unit, without gaps."""

    zone: Annotated[str, StringConstraints(pattern=r"^(UTC|[+-](0\d|1[0-4]):[0-5]\d)$")] = ""
    """Time zone of times that state no time zone: "UTC", or an offset such as "-03:00". Not
    required with `start`, which includes a time zone."""

    column: ColumnName | None = None
    """Name of the time column; only for source "column"; example: "time"."""

    group: GroupName = ""
    """TDMS or MDF4 group of the time column, if the column name is ambiguous."""

    form: Form | None = None
    """Format of the time column: "iso8601" (CSV only), "epoch_s", "epoch_ms", "epoch_us",
    "epoch_ns" (since 1970), "elapsed_s" … "elapsed_ns" (since `start`), "timestamp" (TDMS only)."""

    start: AwareDatetime | None = None
    """Time of the first sample, or origin of elapsed times, with time zone; example:
    2026-03-01T10:00:00-03:00."""

    tolerance: Annotated[float, Field(ge=0.01, le=0.45)] = 0.4
    """Maximum deviation of a time from the uniform sampling at the unit's rate, in sample periods,
    0.01 to 0.45."""


class CsvSettings(Settings):
    """Dialect of a CSV file."""

    delimiter: Annotated[str, StringConstraints(min_length=1, max_length=1)] = ","
    """Separator of columns; example: ";"."""

    decimal: Literal[".", ","] = "."
    """Decimal separator of numbers: "." or ","."""

    header_line: Annotated[int, Field(ge=1, le=1000)] = 1
    """Line number of the column names, from 1; earlier lines are skipped."""


class MappedColumn(Settings):
    """Assignment of a column of an imported file to a channel of the unit."""

    id: Identifier
    """Id of the channel in the plant file; example: "ujb_shaft_x"."""

    column: ColumnName
    """Name of the CSV column or of the TDMS or MDF4 channel, or path of the HDF5 dataset."""

    group: GroupName = ""
    """TDMS group, or name or number of the MDF4 channel group, if the column name is ambiguous."""

    unit: UnitName
    """Unit of the values in the file; example: "um", "mm/s", "g", "mV", "degC", "kW". The import
    fails if the file states a different unit, or if the unit cannot be converted to that of the
    channel."""


class MappedChannel(MappedColumn):
    """Assignment of a column of an imported file to a waveform channel."""

    unit_per_count: Annotated[float, Field(allow_inf_nan=False)] | None = None
    """Scale in `unit` per count, if the column contains counts of the converter; example:
    0.00036621."""


class MappedSlowChannel(MappedColumn):
    """Assignment of a column of an imported file to a slow channel."""

    time_column: ColumnName | None = None
    """Time column of a slow channel whose rate differs from that of the waveforms; its format is
    that of the main time column; example: "slow/time"."""

    time_group: GroupName = ""
    """TDMS or MDF4 group of `time_column`."""


class ImportMapping(Settings):
    """Model of a mapping file, which lists every waveform and slow channel to import."""

    format: Format
    """File format: "mdf4", "tdms", "hdf5", "csv", "candump" or "blf"."""

    time: TimeSettings
    """Source and format of the sample times."""

    csv: CsvSettings | None = None
    """Dialect of a CSV file; only for format "csv"."""

    bus: Annotated[str, StringConstraints(max_length=64)] = ""
    """Bus to import from a CAN log with several buses: name of the bus in a candump log, number of
    the bus, from 1, in a BLF log; examples: "can0", "2"."""

    channel: Annotated[tuple[MappedChannel, ...], Field(max_length=32)] = ()
    """Columns of the waveform channels; none for CAN logs, whose signals are those of the unit's
    DBC file."""

    slow_channel: Annotated[tuple[MappedSlowChannel, ...], Field(max_length=50)] = ()
    """Columns of the slow channels; none for CAN logs."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        self._check_time()
        self._check_channels()
        if self.csv is not None and self.format != "csv":
            raise MisfitError(f"applies only to CSV files, not to {self.format}; remove it", "csv")
        if self.bus and self.format not in CAN_LOGS:
            raise MisfitError(f"applies only to CAN logs, not to {self.format}; remove it", "bus")
        return self

    def _check_time(self) -> None:
        time = self.time
        if time.source == "file" and self.format not in WITH_OWN_TIME:
            raise MisfitError(
                f'must be "column" or "start" for {self.format}, which has no time of its own',
                *("time", "source"),
            )
        if time.source != "file" and self.format in CAN_LOGS:
            raise MisfitError(f'must be "file" for {self.format} logs', "time", "source")
        if time.source == "file" and self.format in IN_UTC and time.zone != "UTC":
            raise MisfitError(f'must be "UTC" for {self.format}, which stores UTC', "time", "zone")
        for key in ("column", "form"):
            is_given, is_needed = getattr(time, key) is not None, time.source == "column"
            if is_needed and not is_given:
                raise MissingError('is missing; source "column" requires it', "time", key)
            if is_given and not is_needed:
                raise MisfitError('applies only to source "column"; remove it', "time", key)
        self._check_form()
        if not time.zone and time.start is None:
            raise MissingError(
                'is missing; give "UTC" or an offset such as "-03:00"', "time", "zone"
            )

    def _check_form(self) -> None:
        form, start = self.time.form or "", self.time.start
        for wanted, only in (("iso8601", "csv"), ("timestamp", "tdms")):
            if form == wanted and self.format != only:
                words = f"applies only to {only}, not to {self.format}; use another form"
                raise MisfitError(words, "time", "form")
        has_start = self.format == "mdf4"
        needs = self.time.source == "start" or (form.startswith("elapsed") and not has_start)
        if needs and start is None:
            raise MissingError("is missing; it is the origin of the times", "time", "start")
        allowed = needs or form.startswith("elapsed")
        if start is not None and not allowed:
            raise MisfitError("does not apply to absolute times; remove it", "time", "start")

    def _check_channels(self) -> None:
        if self.channel and self.format in CAN_LOGS:
            words = f"comes from the DBC file for {self.format}; remove it"
            raise MisfitError(words, "channel")
        if not self.channel and self.format not in CAN_LOGS:
            raise MissingError(f"is missing; format {self.format} requires it", "channel")
        refuse_twice(("channel", n, "id", c.id) for n, c in enumerate(self.channel))
        refuse_twice(("slow_channel", n, "id", c.id) for n, c in enumerate(self.slow_channel))
        if self.format not in WITH_GROUPS:
            self._refuse_groups()

    def _refuse_groups(self) -> None:
        words = f"{self.format} has no groups; remove the group"
        for n, channel in enumerate(self.channel):
            if channel.group:
                raise MisfitError(words, "channel", n, "group")
        for n, slow in enumerate(self.slow_channel):
            if slow.group or slow.time_group:
                raise MisfitError(words, "slow_channel", n)
        if self.time.group:
            raise MisfitError(words, "time", "group")
