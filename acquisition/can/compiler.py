"""Compilation of settings, calibration and DBC file, if they match, into a decoding plan."""

from collections.abc import Mapping

from acquisition.can.dbc import DbcSignal, load_dbc
from acquisition.can.layout import (
    ScalarReader,
    WaveformDecoder,
    is_counts,
    scalar_reader,
    wave_channel,
)
from acquisition.can.plan import EPOCH, MAX_INSTANTS_PER_S, QUANTITIES, MessagePlan, Part, Plan
from acquisition.can.settings import CanSettings, CanSlowChannel
from acquisition.delivery.units import known_unit, spellings
from acquisition.errors import ConfigError
from core.samples.calibration import UnitCalibration

_MIN_COUNTER_BITS = 2
_MAX_SHOWN = 12


def compile_plan(settings: CanSettings, calibration: UnitCalibration) -> Plan:
    """Return the decoding plan of a device; read the DBC file and look up every signal.

    Raises ConfigError if a setting does not fit the DBC; the message contains file, key and
    expected value.
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
        self._messages = load_dbc(settings.dbc, settings.dbc_text)
        self._plans: dict[int, MessagePlan] = {}
        self._waves: list[Part] = []
        self._taken: dict[str, str] = {}

    def plan(self) -> Plan:
        settings, rate_hz = self._settings, self._calibration.rate_hz
        decoder = self._decoder()
        n_per_frame = len(decoder.channels[0].columns)
        for path in settings.counters:
            self._add_counter(path, n_per_frame if settings.counter_counts == "frames" else 1)
        self._add_frame_samples()
        for part in self._waves:
            for key, read in (("counters", part.counter), ("frame_samples", part.n_samples)):
                if getattr(settings, key) and read is None:
                    raise ConfigError(
                        f"{key}: message {part.message} has no signal in the list; list one signal"
                        f" of each message with waveforms, or leave out {key}"
                    )
        if not settings.counters and rate_hz / n_per_frame > MAX_INSTANTS_PER_S:
            raise ConfigError(
                f"counters: list the counter signals; they are required above"
                f" {MAX_INSTANTS_PER_S:g} frames/s of each message, got {rate_hz / n_per_frame:.6g}"
            )
        self._add_values()
        hold = settings.hold_samples
        hold_samples = hold if isinstance(hold, int) else None
        return Plan(self._plans, decoder, self._calibration, hold_samples, settings.hold_s)

    def _decoder(self) -> WaveformDecoder:
        settings = self._settings
        found = [
            [self._own_signal(path, f"signals.{channel.id}") for path in channel.signals]
            for channel in settings.channels
        ]
        channels = []
        for channel, calibration, signals in zip(
            settings.channels, self._calibration.channels, found, strict=True
        ):
            key = f"signals.{channel.id}"
            parts = {self._part_of(signal, key) for signal in signals}
            if len(parts) > 1:
                raise ConfigError(f"{key}: all signals must be in one message")
            if len(signals) != len(found[0]):
                raise ConfigError(
                    f"{key}: names {len(signals)} signals, but {settings.channels[0].id} has"
                    f" {len(found[0])}; all channels must have the same number of samples per frame"
                )
            part = parts.pop()
            if part.wave is None:
                part.wave = len(self._waves)
                self._waves.append(part)
            channels.append(wave_channel(part.wave, channel, calibration, signals))
        in_counts = all(is_counts(signal) for signals in found for signal in signals)
        return WaveformDecoder(tuple(channels), in_counts)

    def _add_counter(self, path: str, step: int) -> None:
        signal = self._integer(path, "counters")
        n_bits = signal.source.length
        if n_bits < _MIN_COUNTER_BITS:
            least = f"at least {_MIN_COUNTER_BITS} bits, got {n_bits}"
            raise ConfigError(f"counters: {path} must have {least}")
        read = scalar_reader(signal)
        for part in self._parts_of(signal):
            if part.counter is not None:
                raise ConfigError(
                    f"counters: message {part.message} has a second counter {path}; list only one"
                )
            part.counter, part.modulus = (lambda data: int(read(data)) * step), step << n_bits

    def _add_frame_samples(self) -> None:
        settings = self._settings
        if settings.frame_samples and not (
            settings.counters and settings.counter_counts == "samples"
        ):
            raise ConfigError('frame_samples requires counters with counter_counts = "samples"')
        for path in settings.frame_samples:
            signal = self._integer(path, "frame_samples")
            for part in self._parts_of(signal):
                part.n_samples = scalar_reader(signal)

    def _add_values(self) -> None:
        for quantity in QUANTITIES:
            path = getattr(self._settings, quantity)
            if not isinstance(path, str):
                continue
            signal = self._integer(path, quantity)
            part, read = self._part_of(signal, quantity), scalar_reader(signal)
            part.values.append((quantity, read))
            if quantity == EPOCH:
                part.epoch = read
                if self._settings.counters and part.counter is None:
                    what = (
                        "its message has no counter, so the start of an epoch is unknown; name"
                        " the counter of the message in counters, or remove epoch"
                    )
                    raise _misfit(EPOCH, path, what)
        for number, slow in enumerate(self._settings.slow):
            key = f"slow.{slow.id}"
            signal = self._own_signal(slow.signal, key)
            self._part_of(signal, key).values.append((number, _scaled(slow, signal)))

    def _signal(self, path: str, key: str) -> DbcSignal:
        """Return the signal "Message.Signal" that a key of the plant file names."""
        name, _, signal = path.partition(".")
        message = self._messages.get(name)
        if message is None:
            known = _shown(self._messages)
            what = f"unknown message {name}; the DBC file has {known}; the form is Message.Signal"
        elif message.nested:
            what = (
                f"message {name} has nested multiplexing, which is not supported; let the device"
                " send the signal in another message"
            )
        elif signal not in message.signals:
            known, missing = _shown(message.signals), signal or "(none given)"
            what = f"message {name} has no signal {missing}; its signals are {known}"
        else:
            return message.signals[signal]
        raise _misfit(key, path, what)

    def _own_signal(self, path: str, key: str) -> DbcSignal:
        """Return a signal; raise ConfigError if another channel already uses it."""
        signal = self._signal(path, key)
        if path in self._taken:
            what = f"is already the signal of {self._taken[path]}; each channel requires its own"
            raise _misfit(key, path, what)
        self._taken[path] = key
        return signal

    def _integer(self, path: str, key: str) -> DbcSignal:
        """Return a signal; raise ConfigError unless it is an unscaled unsigned integer."""
        signal = self._signal(path, key)
        source = signal.source
        if source.is_float or source.is_signed or (source.scale, source.offset) != (1.0, 0.0):
            what = "must be an unsigned integer with factor 1 and offset 0"
            raise _misfit(key, path, what)
        return signal

    def _part_of(self, signal: DbcSignal, key: str) -> Part:
        """Return the part that contains a signal; raise ConfigError if several parts contain it."""
        ids = signal.multiplexer_ids
        if len(ids) > 1 or (signal.message.multiplexer is not None and not ids):
            what = (
                "must be multiplexed like the other signals of its message; only counters and"
                " frame_samples may be in every frame"
            )
            raise _misfit(key, signal.path, what)
        return self._part(signal, ids[0] if ids else 0)

    def _parts_of(self, signal: DbcSignal) -> list[Part]:
        """Return the parts that contain a signal; all parts if the signal is not multiplexed."""
        ids = signal.multiplexer_ids
        if signal.message.multiplexer is not None and not ids:
            ids = sorted({n for s in signal.message.signals.values() for n in s.multiplexer_ids})
        return [self._part(signal, n) for n in ids or [0]]

    def _part(self, signal: DbcSignal, number: int) -> Part:
        message = signal.message
        if message.key not in self._plans:
            reader = scalar_reader(message.multiplexer) if message.multiplexer else None
            self._plans[message.key] = MessagePlan(message, reader)
        return self._plans[message.key].parts.setdefault(number, Part(message.name))


def _scaled(slow: CanSlowChannel, signal: DbcSignal) -> ScalarReader:
    if known_unit(signal.unit) != slow.unit:
        raise ConfigError(
            f'slow.{slow.id}: {signal.path} has unit "{signal.unit}" in the DBC file, expected'
            f" {spellings(slow.unit)}"
        )
    read, scale, offset = scalar_reader(signal), signal.source.scale, signal.source.offset
    return lambda data: read(data) * scale + offset


def _misfit(key: str, path: str, what: str) -> ConfigError:
    return ConfigError(f'{key} = "{path}": {what}')


def _shown(names: Mapping[str, object]) -> str:
    listed = list(names)[:_MAX_SHOWN]
    return ", ".join([*listed, "…"] if len(names) > _MAX_SHOWN else listed)
