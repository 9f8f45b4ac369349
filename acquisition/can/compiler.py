"""Settings, calibration and DBC compiled into a plan; a misfit is found before any frame."""

from collections.abc import Mapping
from typing import TypeAlias

from acquisition.can.dbc import DbcSignal, load_dbc, parse_dbc
from acquisition.can.layout import (
    FrameLayout,
    ScalarReader,
    WaveChannel,
    WaveformDecoder,
    gain_and_offset,
    is_counts,
    require_full_scale,
    scalar_reader,
)
from acquisition.can.plan import (
    EPOCH,
    HOLD,
    MAX_INSTANTS_PER_S,
    MICROSECONDS,
    OK_BITS,
    SECONDS,
    MessageCounter,
    MessagePlan,
    Part,
    Plan,
)
from acquisition.can.settings import CanChannel, CanSettings, CanSlowChannel
from acquisition.delivery.calibration import UnitCalibration
from acquisition.delivery.units import known_unit, spellings
from acquisition.errors import ConfigError

PartKey: TypeAlias = tuple[str, int]
"""Name of a message and value of its multiplexer; 0 without one."""

_MIN_COUNTER_BITS = 2
_MAX_SHOWN = 12


def compile_plan(settings: CanSettings, calibration: UnitCalibration) -> Plan:
    """Read the DBC and find every signal in it.

    Raises
    ------
    ConfigError
        Naming file, key, what was found and what is needed.
    """
    try:
        return _Compiler(settings, calibration).plan()
    except ConfigError as exc:
        where = str(settings.dbc)
        raise exc if where in str(exc) else ConfigError(f"{where}: {exc}") from exc


class _Compiler:
    def __init__(self, settings: CanSettings, calibration: UnitCalibration) -> None:
        self._settings = settings
        self._calibration = calibration
        text = settings.dbc_text
        self._messages = load_dbc(settings.dbc) if text is None else parse_dbc(text, settings.dbc)
        self._taken: dict[str, str] = {}
        self._waves: list[PartKey] = []
        self._wave_signals: list[list[DbcSignal]] = []
        self._channels: list[list[DbcSignal]] = []

    def plan(self) -> Plan:
        settings = self._settings
        for channel in settings.channels:
            self._add_channel(channel)
        decoder = self._decoder()
        values = self._values()
        counters = self._counters()
        n_samples = {
            part: scalar_reader(signal)
            for path in settings.frame_samples
            for signal in [self._integer(path, "frame_samples")]
            for part in _parts_of(signal)
        }
        self._require_all_or_none(counters, "counters")
        self._require_all_or_none(n_samples, "frame_samples")
        if n_samples and settings.counter_counts == "frames":
            raise ConfigError('frame_samples needs counter_counts = "samples"')
        self._require_counter_of_epoch(counters)
        self._require_losses_are_seen(counters)
        messages: dict[int, MessagePlan] = {}
        for key in sorted({*self._waves, *values, *counters}):
            found = values.get(key, [])
            self._plan_of(key[0], messages).parts[key[1]] = Part(
                name=key[0],
                wave=self._waves.index(key) if key in self._waves else None,
                counter=counters.get(key),
                n_samples=n_samples.get(key),
                values=tuple(found),
                epoch=dict(found).get(EPOCH),
            )
        hold = settings.hold_samples
        return Plan(
            messages=messages,
            n_waves=len(self._waves),
            samples_per_frame=self._samples_per_frame,
            decoder=decoder,
            counted=bool(counters),
            widest_modulus=max((c.modulus for c in counters.values()), default=0),
            quantities=frozenset(key for found in values.values() for key, _ in found),
            hold_samples=hold if isinstance(hold, int) else None,
        )

    @property
    def _samples_per_frame(self) -> int:
        return len(self._channels[0])

    def _signal(self, path: str, key: str) -> DbcSignal:
        """The signal "Message.Signal" that a key of the plant file names."""
        name, _, signal = path.partition(".")
        message = self._messages.get(name)
        if message is None:
            raise _misfit(
                key,
                path,
                f"no message {name} in the DBC; there are {_shown(self._messages)};"
                " write Message.Signal",
            )
        if message.nested:
            raise _misfit(
                key,
                path,
                f"message {name} is multiplexed twice over, which is not supported; let the device"
                " send the signal in a message of its own",
            )
        if signal not in message.signals:
            raise _misfit(
                key,
                path,
                f"message {name} has no signal {signal or '(none given)'}; there are"
                f" {_shown(message.signals)}",
            )
        return message.signals[signal]

    def _own_signal(self, path: str, key: str) -> DbcSignal:
        """A signal that no other channel may have."""
        signal = self._signal(path, key)
        if path in self._taken:
            what = f"is already the signal of {self._taken[path]}; each channel needs its own"
            raise _misfit(key, path, what)
        self._taken[path] = key
        return signal

    def _integer(self, path: str, key: str) -> DbcSignal:
        """A signal that is a plain number: neither scaled, signed nor a float."""
        signal = self._signal(path, key)
        if signal.is_float or signal.signed or (signal.scale, signal.offset) != (1.0, 0.0):
            what = "must be an unsigned integer with factor 1 and offset 0"
            raise _misfit(key, path, what)
        return signal

    def _add_channel(self, channel: CanChannel) -> None:
        key = f"signals.{channel.id}"
        if not channel.signals:
            raise ConfigError(f"{key}: names no signal; needed is one for each sample in a frame")
        found = [self._own_signal(path, key) for path in channel.signals]
        parts = {_part_of(signal, key) for signal in found}
        if len(parts) > 1:
            raise ConfigError(f"{key}: its signals must all be in one message")
        if self._channels and len(found) != self._samples_per_frame:
            raise ConfigError(
                f"{key}: has {len(found)} samples in a frame, {self._settings.channels[0].id} has"
                f" {self._samples_per_frame}; all channels must have as many"
            )
        part = parts.pop()
        if part not in self._waves:
            self._waves.append(part)
            self._wave_signals.append([])
        self._wave_signals[self._waves.index(part)] += found
        self._channels.append(found)

    def _decoder(self) -> WaveformDecoder:
        pairs = list(zip(self._settings.channels, self._calibration.channels, strict=True))
        in_counts = all(is_counts(s) for signals in self._channels for s in signals)
        channels = []
        for (channel, calibration), signals in zip(pairs, self._channels, strict=True):
            scalings = {gain_and_offset(channel, calibration, s) for s in signals}
            if len(scalings) > 1:
                raise ConfigError(f"signals.{channel.id}: its signals have different factors")
            for signal in signals:
                if is_counts(signal):
                    require_full_scale(channel, calibration, signal)
            part = _part_of(signals[0], f"signals.{channel.id}")
            names = tuple(signal.name for signal in signals)
            channels.append(WaveChannel(self._waves.index(part), names, *scalings.pop()))
        layouts = [FrameLayout(signals[0].message, signals) for signals in self._wave_signals]
        return WaveformDecoder(layouts, channels, in_counts)

    def _values(self) -> dict[PartKey, list[tuple[str | int, ScalarReader]]]:
        settings = self._settings
        hold = settings.hold_samples
        named = {
            EPOCH: ("epoch", settings.epoch),
            OK_BITS: ("ok_bits", settings.ok_bits),
            SECONDS: ("seconds", settings.seconds),
            MICROSECONDS: ("microseconds", settings.microseconds),
            HOLD: ("hold_samples", hold if isinstance(hold, str) else None),
        }
        found: dict[PartKey, list[tuple[str | int, ScalarReader]]] = {}
        for quantity, (key, path) in named.items():
            if path is not None:
                signal = self._integer(path, key)
                found.setdefault(_part_of(signal, key), []).append(
                    (quantity, scalar_reader(signal))
                )
        for number, slow in enumerate(settings.slow):
            key = f"slow.{slow.id}"
            signal = self._own_signal(slow.signal, key)
            found.setdefault(_part_of(signal, key), []).append((number, _scaled(slow, signal)))
        return found

    def _counters(self) -> dict[PartKey, MessageCounter]:
        step = self._samples_per_frame if self._settings.counter_counts == "frames" else 1
        counters: dict[PartKey, MessageCounter] = {}
        for path in self._settings.counters:
            signal = self._integer(path, "counters")
            if signal.n_bits < _MIN_COUNTER_BITS:
                raise ConfigError(f"counters: {path} has {signal.n_bits} bits, too few to count")
            counter = MessageCounter(scalar_reader(signal), step << signal.n_bits, step)
            for part in _parts_of(signal):
                if part in counters:
                    raise ConfigError(f"counters: {path} is the second of message {part[0]}")
                counters[part] = counter
        return counters

    def _require_all_or_none(self, given: Mapping[PartKey, object], key: str) -> None:
        missing = [part for part in self._waves if part not in given]
        if given and missing:
            raise ConfigError(
                f"{key}: message {missing[0][0]} carries waveforms but none of the signals named;"
                " name one for each such message, or none at all"
            )

    def _require_counter_of_epoch(self, counters: Mapping[PartKey, object]) -> None:
        path = self._settings.epoch
        if path and counters and _part_of(self._signal(path, "epoch"), "epoch") not in counters:
            what = (
                "its message has no counter, so that it is unknown from which sample on it holds;"
                " name its counter under counters, or leave epoch out"
            )
            raise _misfit("epoch", path, what)

    def _require_losses_are_seen(self, counters: Mapping[PartKey, object]) -> None:
        instants_per_s = self._calibration.rate_hz / self._samples_per_frame
        if not counters and instants_per_s > MAX_INSTANTS_PER_S:
            raise ConfigError(
                f"counters: none is named, and {instants_per_s:.6g} frames a second of each message"
                " are too many to find losses by the clock alone, which can"
                f" {MAX_INSTANTS_PER_S:g}; name the counters, or let the device send fewer"
            )

    def _plan_of(self, name: str, messages: dict[int, MessagePlan]) -> MessagePlan:
        message = self._messages[name]
        if message.key not in messages:
            multiplexer = message.multiplexer
            reader = scalar_reader(message.signals[multiplexer]) if multiplexer else None
            messages[message.key] = MessagePlan(message, reader)
        return messages[message.key]


def _part_of(signal: DbcSignal, key: str) -> PartKey:
    """The one part of a message that has a signal."""
    ids, message = signal.multiplexer_ids, signal.message
    if len(ids) > 1 or (message.multiplexer is not None and not ids):
        what = "is in every frame of a multiplexed message; only counters and frame_samples may be"
        raise _misfit(key, signal.path, what)
    return message.name, ids[0] if ids else 0


def _parts_of(signal: DbcSignal) -> list[PartKey]:
    """Where a signal can be used: a multiplexed message's common signals, in all its parts."""
    message = signal.message
    if signal.multiplexer_ids or message.multiplexer is None:
        return [(message.name, n) for n in signal.multiplexer_ids or (0,)]
    ids = {n for s in message.signals.values() for n in s.multiplexer_ids}
    return [(message.name, n) for n in sorted(ids)]


def _scaled(slow: CanSlowChannel, signal: DbcSignal) -> ScalarReader:
    if known_unit(signal.unit) != slow.unit:
        raise ConfigError(
            f'slow.{slow.id}: {signal.path} has unit "{signal.unit}" in the DBC; needed is'
            f" {spellings(slow.unit)}"
        )
    read, scale, offset = scalar_reader(signal), signal.scale, signal.offset
    return lambda data: read(data) * scale + offset


def _misfit(key: str, path: str, what: str) -> ConfigError:
    return ConfigError(f'{key} = "{path}": {what}')


def _shown(names: Mapping[str, object]) -> str:
    listed = list(names)[:_MAX_SHOWN]
    return ", ".join([*listed, "…"] if len(names) > _MAX_SHOWN else listed)
