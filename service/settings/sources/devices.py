"""Settings of Modbus sources, and the union of the settings of all source kinds."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from acquisition.modbus.fifo_assembly import FifoKind, FifoLayout
from acquisition.modbus.register_map import RegisterMap
from acquisition.modbus.requests import MAX_FIFO_REGISTERS
from core.spectra.polls import PollSettings, VectorPart, VectorRow
from service.settings.base import MisfitError, Settings
from service.settings.sources.can import CanSettings
from service.settings.sources.modbus import ModbusLinkSettings
from service.settings.sources.register_map import RegisterMapSettings, load_map_file
from service.settings.toml_file import FOLDER, TomlFileError

MIN_STALE_POLLS = 2


class MappedDeviceSettings(ModbusLinkSettings):
    """Settings of a Modbus device with a register map."""

    map: RegisterMapSettings | None = None
    """Register map of the device; either this table or map_file is required."""

    map_file: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    """File with the register map, relative to the folder of the plant file; example:
    "maps/vector-rack.toml"."""

    poll_period_s: Annotated[float, Field(ge=0.01, le=86_400.0)]
    """Time between polls, s, at least min_poll_period_s of the register map; example: 1.0."""

    stale_after_s: Annotated[float, Field(ge=0.1, le=604_800.0)] = 60.0
    """Time without a change after which the device counts as not connected, s; at least two poll
    periods. The change is that of the heartbeat, otherwise of the time stamp, otherwise of any
    value."""

    connection: Literal["kept", "per_reply"] = "kept"
    """Use of TCP connections: with "kept" one connection is reused; with "per_reply" each request
    opens a new connection, for a device that closes idle connections or that accepts only one
    connection, shared with other clients. Must be "kept" on a serial line."""

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
            raise MisfitError(f"must be at least two poll periods, {least:g} s", "stale_after_s")
        return self

    def _found_map(self, folder: Path) -> RegisterMapSettings:
        if self.map is not None and self.map_file is None:
            return self.map
        if self.map_file is None or self.map is not None:
            raise MisfitError("exactly one of map and map_file must be given", "map_file")
        try:
            return load_map_file(folder / self.map_file)
        except TomlFileError as error:
            mistakes = str(error).replace("\n", "; ")
            raise MisfitError(f"register map cannot be used: {mistakes}", "map_file") from error

    def _require_least(self, key: str, least: float) -> None:
        if getattr(self, key) < least:
            raise MisfitError(f"must be at least {least:g} s, the minimum in the register map", key)

    @property
    def rate_hz(self) -> float:
        """Poll rate, which is the sampling rate of the unit, Hz."""
        return 1.0 / self.poll_period_s

    @property
    def registers(self) -> RegisterMap:
        """Register map of the device, as a `RegisterMap` of the Modbus adapter."""
        return self._map.register_map()

    @property
    def mapped_channels(self) -> tuple[str, ...]:
        """Ids of the channels and slow channels with quantity "value" in the map."""
        return tuple(v.channel for v in self._map.value if not isinstance(v.quantity, VectorPart))

    @property
    def rows(self) -> tuple[VectorRow, ...]:
        """Rows of vector quantities (such as 1× amplitudes), in the order of the map."""
        return tuple(
            VectorRow(v.channel, v.quantity)
            for v in self._map.value
            if isinstance(v.quantity, VectorPart)
        )

    def require_known(self, known: Sequence[str], *at: int | str) -> None:
        """Raise `MisfitError` if the map has a value of a channel that is not in ``known``.

        ``at`` is the key of this device in the unit, for the location of the error.
        """
        for n, value in enumerate(self._map.value):
            if value.channel not in known:
                place = (*at, "map", "value", n, "channel") if self.map else (*at, "map_file")
                words = ", ".join(known) or "none"
                words = f"unknown channel {value.channel!r}; known channels: {words}"
                raise MisfitError(words, *place)


class ModbusPolledSettings(MappedDeviceSettings):
    """Settings of a device with polled registers; each poll gives one sample. For slow machines."""

    kind: Literal["modbus_polled"]
    """Kind of the source, always "modbus_polled"."""

    def require_fit(self, channels: Sequence[str], slow: Sequence[str]) -> None:
        """Check that the register map matches the channels of the unit.

        Raises `MisfitError` if a waveform channel has no value, a value belongs to no channel, or
        the map has vector quantities.
        """
        self.require_known([*channels, *slow], "source")
        for row in self.rows:
            raise MisfitError(
                f'quantity "{row.part}" of {row.channel!r} requires kind "modbus_vector"',
                *("source", "map_file" if self.map_file else "map"),
            )
        _require_all(self, channels, self.mapped_channels)


class ModbusVectorSettings(MappedDeviceSettings):
    """Settings of a monitoring rack that reports 1× vectors or amplitudes instead of waveforms."""

    kind: Literal["modbus_vector"]
    """Kind of the source, always "modbus_vector"."""

    n_polls: Annotated[int, Field(ge=2, le=100_000)] = 60
    """Number of averaged polls; 60 polls at 5 s are five minutes."""

    hop_polls: Annotated[int, Field(ge=1, le=100_000)] = 4
    """Number of polls from one result to the next, not above n_polls; 4 polls at 5 s are 20 s.
    Alarm limits are checked with each result."""

    min_polls: Annotated[int, Field(ge=2, le=100_000)] = 4
    """Number of polls with a changed vector below which a result is uncertain; not above
    n_polls."""

    @model_validator(mode="after")
    def _check_polls(self) -> Self:
        for key in ("hop_polls", "min_polls"):
            if getattr(self, key) > self.n_polls:
                raise MisfitError(f"must not be above n_polls, {self.n_polls}", key)
        return self

    @property
    def averaging(self) -> PollSettings:
        """Settings of the averaging of polls, as `PollSettings`."""
        return PollSettings(self.n_polls, self.hop_polls, self.min_polls)

    def require_fit(self, channels: Sequence[str], slow: Sequence[str]) -> None:
        """Check that the register map matches the channels of the unit.

        Raises `MisfitError` if a waveform channel has no 1× amplitude, or has quantity "value".
        """
        self.require_known([*channels, *slow], "source")
        given = [r.channel for r in self.rows if r.part is VectorPart.ORDER1_AMPLITUDE]
        _require_all(self, channels, given, ' with quantity = "order1_amplitude"')
        for channel in self.mapped_channels:
            if channel in channels:
                raise MisfitError(
                    f'value of {channel!r} requires a vector quantity such as "order1_amplitude"',
                    *("source", "map_file" if self.map_file else "map"),
                )


class SlowDeviceSettings(MappedDeviceSettings):
    """Settings of a second device of a unit, which reports slow values."""

    def require_fit(self, slow: Sequence[str]) -> None:
        """Check that the register map matches the slow channels of the unit.

        Raises `MisfitError` if a value belongs to no slow channel.
        """
        self.require_known(slow, "slow_source")


class ModbusFifoSettings(ModbusLinkSettings):
    """Settings of a device with FIFO queues of samples, read by Modbus function 0x18."""

    kind: Literal["modbus_fifo"]
    """Kind of the source, always "modbus_fifo"."""

    layout: FifoKind = FifoKind.INTERLEAVED
    """Layout of the queues: "interleaved" is one queue with a record of all channels per sample,
    "per_channel" is one queue per channel."""

    addresses: Annotated[
        tuple[Annotated[int, Field(ge=0, le=65_535)], ...], Field(min_length=1, max_length=32)
    ]
    """Address of the interleaved queue, or addresses of the queues of all channels, counted from 0;
    example: [1000]."""

    has_counter: bool = True
    """Whether each record (interleaved), or each reply (per channel), begins with an unsigned
    16-bit sample counter. Without a counter only long losses are detected, and their length is
    unknown."""

    reading: Literal["removes", "keeps"] = "removes"
    """Effect of reading on the queue: "removes" the samples that are read, or "keeps" them."""

    poll_period_s: Annotated[float, Field(ge=0.001, le=60.0)] = 0.005
    """Pause after a read that emptied the queue, s."""

    stale_after_s: Annotated[float, Field(ge=0.1, le=3600.0)] = 3.0
    """Time after which the device counts as not connected if no new sample arrives, or if the queue
    is never empty, s."""

    loss_tolerance_s: Annotated[float, Field(ge=0.01, le=10.0)] = 0.1
    """Minimum length of a loss that is detected without a counter, s; shorter losses are
    indistinguishable from jitter."""

    @model_validator(mode="after")
    def _check_queues(self) -> Self:
        if not self.has_counter and self.layout is FifoKind.PER_CHANNEL:
            raise MisfitError(
                'must be true with layout = "per_channel": only a counter shows which samples'
                " belong together",
                "has_counter",
            )
        if not self.has_counter and self.reading == "keeps":
            raise MisfitError(
                'must be true with reading = "keeps": only a counter shows which samples are new',
                "has_counter",
            )
        if len(set(self.addresses)) < len(self.addresses):
            raise MisfitError("must not contain an address twice: queues are distinct", "addresses")
        return self

    def fifo_layout(self, n_channels: int) -> FifoLayout:
        """Return the layout of the queues for ``n_channels`` channels, as a `FifoLayout`.

        Raises `MisfitError` if the number of addresses is wrong, or if a record of all channels
        exceeds a FIFO read of 31 registers.
        """
        n_queues = 1 if self.layout is FifoKind.INTERLEAVED else n_channels
        if len(self.addresses) != n_queues:
            words = f"number of addresses must be {n_queues}, got {len(self.addresses)}"
            raise MisfitError(words, "source", "addresses")
        layout = FifoLayout(
            addresses=self.addresses,
            n_channels=n_channels,
            kind=self.layout,
            has_counter=self.has_counter,
            removes=self.reading == "removes",
        )
        if layout.record_registers > MAX_FIFO_REGISTERS:
            raise MisfitError(
                f"a record has {layout.record_registers} registers, but a FIFO read returns at most"
                f' {MAX_FIFO_REGISTERS}; use layout = "per_channel" or fewer channels',
                *("source", "addresses"),
            )
        return layout


def _require_all(
    device: MappedDeviceSettings, wanted: Sequence[str], given: Sequence[str], what: str = ""
) -> None:
    for channel in wanted:
        if channel not in given:
            raise MisfitError(
                f"has no value for channel {channel!r}; add a [[value]] table{what}",
                *("source", "map_file" if device.map_file else "map"),
            )


class ModbusRingSettings(ModbusLinkSettings):
    """Settings of a streaming DAQ with a block ring, over Modbus TCP or RTU."""

    kind: Literal["modbus_ring"]
    """Kind of the source, always "modbus_ring"."""

    base_address: Annotated[int, Field(ge=0, le=65520)] = 0
    """Address of the header of the block ring, counted from 0."""

    function: Literal[3, 4] = 3
    """Modbus function code of the registers: 3 (holding) or 4 (input)."""

    poll_period_s: Annotated[float, Field(ge=0.01, le=60.0)] = 1.0
    """Maximum time between polls of the ring, s; a ring of a shorter time span is polled four times
    in this span. The actual period is slightly shorter and asynchronous to the slots, in order to
    measure the sampling rate."""

    stale_after_s: Annotated[float, Field(ge=0.1, le=3600.0)] = 3.0
    """Time without a new slot after which the DAQ counts as not connected, s."""


class SimulatedSettings(Settings):
    """Settings of a unit that is simulated in this process, without a device."""

    kind: Literal["simulated"]
    """Kind of the source, always "simulated"."""


ModbusSettings = (
    ModbusRingSettings | ModbusFifoSettings | ModbusPolledSettings | ModbusVectorSettings
)

SourceSettings = Annotated[
    ModbusSettings | CanSettings | SimulatedSettings, Field(discriminator="kind")
]
"""Settings of a source of samples, of any kind."""
