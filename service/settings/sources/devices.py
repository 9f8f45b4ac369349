"""Sources of the plant file: Modbus devices, and the union of all kinds."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from acquisition.modbus.cells import MapError
from acquisition.modbus.fifo_layout import FifoKind, FifoLayout
from acquisition.modbus.register_map import RegisterMap
from core.spectra.polls import PollSettings, VectorPart, VectorRow
from service.settings.base import MisfitError, Settings
from service.settings.sources.can import CanSettings
from service.settings.sources.modbus import ModbusLinkSettings
from service.settings.sources.register_map import RegisterMapSettings, load_map_file
from service.settings.toml_file import FOLDER, TomlFileError

MIN_STALE_POLLS = 2


class MappedDeviceSettings(ModbusLinkSettings):
    """A device that is read by a register map."""

    map: RegisterMapSettings | None = None
    """What stands where in it; or a file that says so."""

    map_file: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    """A register map in a file of its own, seen from the plant file's folder; example:
    "maps/vector-rack.toml"."""

    poll_period_s: Annotated[float, Field(ge=0.01, le=86_400.0)]
    """Time between polls in seconds; not below what the map asks for; example: 1.0."""

    stale_after_s: Annotated[float, Field(ge=0.1, le=604_800.0)] = 60.0
    """A device in which nothing changes for longer than this counts as not connected: its
    heartbeat, else its time, else everything that is read. At least two poll periods."""

    connection: Literal["kept", "per_reply"] = "kept"
    """"kept": one connection for as long as it works. "per_reply": a new one for each request, for
    a device that closes it after each reply or when it is not asked for a while, or that has a
    single one which others need, too. Not on a serial line."""

    _map: RegisterMapSettings = PrivateAttr()

    @model_validator(mode="after")
    def _check_map(self, info: ValidationInfo) -> Self:
        self._map = self._found_map((info.context or {}).get(FOLDER, Path()))
        self._require_least("poll_period_s", self._map.min_poll_period_s)
        self._require_least("timeout_s", self._map.min_timeout_s)
        if self.device is not None and self.connection != "kept":
            raise MisfitError('must be "kept" on a serial line', "connection")
        if self.connection != "kept" and (self.requests_in_flight or 1) > 1:
            raise MisfitError('must be 1 with connection = "per_reply"', "requests_in_flight")
        if self.stale_after_s < MIN_STALE_POLLS * self.poll_period_s:
            least = MIN_STALE_POLLS * self.poll_period_s
            raise MisfitError(f"must be two poll periods or more, {least:g}", "stale_after_s")
        return self

    def _found_map(self, folder: Path) -> RegisterMapSettings:
        if self.map is not None and self.map_file is None:
            return self.map
        if self.map_file is None or self.map is not None:
            raise MisfitError('give either a [map] table or "map_file"', "map_file")
        try:
            return load_map_file(folder / self.map_file)
        except TomlFileError as error:
            mistakes = str(error).replace("\n", "; ")
            raise MisfitError(f"names a map that cannot be used: {mistakes}", "map_file") from error

    def _require_least(self, key: str, least: float) -> None:
        if getattr(self, key) < least:
            raise MisfitError(f"must be {least:g} or more, as the register map asks", key)

    @property
    def rate_hz(self) -> float:
        """Polls per second: the unit's sampling rate."""
        return 1.0 / self.poll_period_s

    @property
    def registers(self) -> RegisterMap:
        """The map as the adapters take it."""
        return self._map.register_map()

    @property
    def mapped_channels(self) -> tuple[str, ...]:
        """Ids of the channels and slow channels whose plain values are read."""
        return tuple(v.channel for v in self._map.value if not isinstance(v.quantity, VectorPart))

    @property
    def rows(self) -> tuple[VectorRow, ...]:
        """What is read of vectors, in the order of the map."""
        return tuple(
            VectorRow(v.channel, v.quantity)
            for v in self._map.value
            if isinstance(v.quantity, VectorPart)
        )

    def require_known(self, known: Sequence[str], *at: int | str) -> None:
        """Refuse values of unknown channels. Raises `MisfitError` if the map has one."""
        for n, value in enumerate(self._map.value):
            if value.channel not in known:
                place = (*at, "map", "value", n, "channel") if self.map else (*at, "map_file")
                words = ", ".join(known) or "none"
                raise MisfitError(
                    f"no such channel as {value.channel!r}; there are {words}", *place
                )


class ModbusPolledSettings(MappedDeviceSettings):
    """Registers read again and again, each poll a sample; for slow machines and slow values."""

    kind: Literal["modbus_polled"]
    """This source's kind."""

    def require_fit(self, channels: Sequence[str], slow: Sequence[str]) -> None:
        """Refuse a map that does not fit the channels of the unit.

        Raises `MisfitError` if a waveform channel is missing, or the map has vectors.
        """
        self.require_known([*channels, *slow], "source")
        for row in self.rows:
            raise MisfitError(
                f'gives {row.part} of {row.channel!r}: that is for kind "modbus_vector"',
                *("source", "map_file" if self.map_file else "map"),
            )
        _require_all(self, channels, self.mapped_channels)


class ModbusVectorSettings(MappedDeviceSettings):
    """A rack that gives 1× amplitudes, and perhaps phases, instead of waveforms."""

    kind: Literal["modbus_vector"]
    """This source's kind."""

    n_polls: Annotated[int, Field(ge=2, le=100_000)] = 60
    """Polls that are averaged; 60 of 5 s are five minutes."""

    hop_polls: Annotated[int, Field(ge=1, le=100_000)] = 4
    """Polls from one result to the next, when limits of vibration are judged: four of 5 s are 20 s;
    not above n_polls."""

    min_polls: Annotated[int, Field(ge=2, le=100_000)] = 4
    """Polls with a changed vector below which a result is uncertain; not above n_polls."""

    @model_validator(mode="after")
    def _check_polls(self) -> Self:
        for key in ("hop_polls", "min_polls"):
            if getattr(self, key) > self.n_polls:
                raise MisfitError(f"must not be above n_polls, {self.n_polls}", key)
        return self

    @property
    def averaging(self) -> PollSettings:
        """Which polls make a result."""
        return PollSettings(self.n_polls, self.hop_polls, self.min_polls)

    def require_fit(self, channels: Sequence[str], slow: Sequence[str]) -> None:
        """Refuse a map that does not fit the channels of the unit.

        Raises `MisfitError` if a 1× amplitude is missing, or the map has plain values.
        """
        self.require_known([*channels, *slow], "source")
        given = [r.channel for r in self.rows if r.part is VectorPart.ORDER1_AMPLITUDE]
        _require_all(self, channels, given, ' with quantity = "order1_amplitude"')
        for channel in self.mapped_channels:
            if channel in channels:
                raise MisfitError(
                    f'gives a plain value of {channel!r}; a rack\'s values need a "quantity"',
                    *("source", "map_file" if self.map_file else "map"),
                )


class SlowDeviceSettings(MappedDeviceSettings):
    """A device of slow values beside the one that the waveforms come from."""

    def require_fit(self, slow: Sequence[str]) -> None:
        """Refuse a map that does not fit the slow channels of the unit.

        Raises `MisfitError` if a value belongs to no slow channel.
        """
        self.require_known(slow, "slow_source")


class ModbusFifoSettings(ModbusLinkSettings):
    """A device whose samples are read from queues, by function 0x18."""

    kind: Literal["modbus_fifo"]
    """This source's kind."""

    layout: FifoKind = FifoKind.INTERLEAVED
    """"interleaved": one queue with a record of all channels for each sample. "per_channel": a
    queue for each channel."""

    addresses: Annotated[
        tuple[Annotated[int, Field(ge=0, le=65_535)], ...], Field(min_length=1, max_length=32)
    ]
    """Address of the queue, or of the queue of each channel, counted from 0; example: [1000]."""

    has_counter: bool = True
    """Whether a record, or a reading of a channel's queue, begins with an unsigned 16-bit counter
    of samples. Without it only long losses are noticed, and how long is not known."""

    reading: Literal["removes", "keeps"] = "removes"
    """Whether reading takes samples out of the queue ("removes") or shows them again ("keeps")."""

    poll_period_s: Annotated[float, Field(ge=0.001, le=60.0)] = 0.005
    """Wait after a reading that has emptied the queue, in seconds."""

    stale_after_s: Annotated[float, Field(ge=0.1, le=3600.0)] = 3.0
    """A device without a new sample, or a queue that never runs empty, for longer than this counts
    as not connected."""

    loss_tolerance_s: Annotated[float, Field(ge=0.01, le=10.0)] = 0.1
    """Without a counter: a loss shorter than this cannot be told from jitter."""

    def fifo_layout(self, n_channels: int) -> FifoLayout:
        """The queues as the adapter takes them.

        Raises `MisfitError` if the channels do not fit into a FIFO read of 31 registers, or cannot
        be told apart.
        """
        try:
            return FifoLayout(
                addresses=self.addresses,
                n_channels=n_channels,
                kind=self.layout,
                has_counter=self.has_counter,
                removes=self.reading == "removes",
            )
        except MapError as error:
            raise MisfitError(str(error), "source", *error.at) from error


def _require_all(
    device: MappedDeviceSettings, wanted: Sequence[str], given: Sequence[str], what: str = ""
) -> None:
    for channel in wanted:
        if channel not in given:
            raise MisfitError(
                f"has no value for channel {channel!r}; add a [[value]] for it{what}",
                *("source", "map_file" if device.map_file else "map"),
            )


class ModbusRingSettings(ModbusLinkSettings):
    """A streaming DAQ with a block ring, over Modbus TCP or RTU."""

    kind: Literal["modbus_ring"]
    """This source's kind."""

    base_address: Annotated[int, Field(ge=0, le=65520)] = 0
    """Address of the profile's header, counted from 0."""

    function: Literal[3, 4] = 3
    """Function code that reads the registers: 3 (holding) or 4 (input)."""

    poll_period_s: Annotated[float, Field(ge=0.01, le=60.0)] = 0.25
    """Longest time between looks at the ring in seconds; the ring must hold several of them. It is
    looked at a little sooner, out of step with its slots, which shows how fast the DAQ samples."""

    stale_after_s: Annotated[float, Field(ge=0.1, le=3600.0)] = 3.0
    """A DAQ whose newest slot stands still for this long counts as not connected."""


class SimulatedSettings(Settings):
    """The unit's simulation read in this process, without any wire."""

    kind: Literal["simulated"]
    """This source's kind."""


SourceSettings = Annotated[
    ModbusRingSettings
    | ModbusFifoSettings
    | ModbusPolledSettings
    | ModbusVectorSettings
    | CanSettings
    | SimulatedSettings,
    Field(discriminator="kind"),
]
