"""Settings, calibration and DBC compiled into a plan; a misfit is found before any frame."""

from collections.abc import Mapping

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
from acquisition.can.signals import Place, SignalTable
from acquisition.can.units import known_unit, spellings
from acquisition.delivery.calibration import UnitCalibration
from acquisition.errors import ConfigError

_MIN_COUNTER_BITS = 2


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
        messages = load_dbc(settings.dbc) if text is None else parse_dbc(text, settings.dbc)
        self._table = SignalTable(messages)
        self._waves: list[Place] = []
        self._wave_signals: list[list[DbcSignal]] = []
        self._channels: list[list[DbcSignal]] = []

    def plan(self) -> Plan:
        settings = self._settings
        for channel in settings.channels:
            self._add_channel(channel)
        decoder = self._decoder()
        values = self._values()
        counters = self._counters()
        n_samples = self._frame_samples()
        self._require_all_or_none(counters, "counters")
        self._require_all_or_none(n_samples, "frame_samples")
        if n_samples and settings.counter_counts == "frames":
            raise ConfigError('frame_samples needs counter_counts = "samples"')
        self._require_counter_of_epoch(counters)
        self._require_losses_are_seen(counters)
        parts = {*self._waves, *values, *counters}
        messages: dict[int, MessagePlan] = {}
        for place in sorted(parts):
            part = self._part(place, values.get(place, []), counters, n_samples)
            self._plan_of(place[0], messages).parts[place[1]] = part
        moduli = [c.modulus for c in counters.values()]
        hold = settings.hold_samples
        return Plan(
            messages=messages,
            n_waves=len(self._waves),
            samples_per_frame=self._samples_per_frame,
            decoder=decoder,
            counted=bool(counters),
            widest_modulus=max(moduli, default=0),
            quantities=frozenset(key for found in values.values() for key, _ in found),
            hold_samples=hold if isinstance(hold, int) else None,
        )

    @property
    def _samples_per_frame(self) -> int:
        return len(self._channels[0])

    def _add_channel(self, channel: CanChannel) -> None:
        key = f"signals.{channel.id}"
        if not channel.signals:
            raise ConfigError(f"{key}: names no signal; needed is one for each sample in a frame")
        found = [self._table.take(path, key) for path in channel.signals]
        places = {self._table.place(signal, key) for signal in found}
        if len(places) > 1:
            raise ConfigError(f"{key}: its signals must all be in one message")
        if self._channels and len(found) != self._samples_per_frame:
            raise ConfigError(
                f"{key}: has {len(found)} samples in a frame, {self._settings.channels[0].id} has"
                f" {self._samples_per_frame}; all channels must have as many"
            )
        place = places.pop()
        if place not in self._waves:
            self._waves.append(place)
            self._wave_signals.append([])
        self._wave_signals[self._waves.index(place)] += found
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
            place = self._table.place(signals[0], f"signals.{channel.id}")
            names = tuple(signal.name for signal in signals)
            channels.append(WaveChannel(self._waves.index(place), names, *scalings.pop()))
        layouts = [FrameLayout(signals[0].message, signals) for signals in self._wave_signals]
        return WaveformDecoder(layouts, channels, in_counts)

    def _values(self) -> dict[Place, list[tuple[str | int, ScalarReader]]]:
        settings = self._settings
        hold = settings.hold_samples
        named = {
            EPOCH: settings.epoch,
            OK_BITS: settings.ok_bits,
            SECONDS: settings.seconds,
            MICROSECONDS: settings.microseconds,
            HOLD: hold if isinstance(hold, str) else None,
        }
        found: dict[Place, list[tuple[str | int, ScalarReader]]] = {}
        for key, path in named.items():
            if path is not None:
                signal = self._table.find(path, "hold_samples" if key == HOLD else key)
                self._table.require_integer(signal, key)
                place = self._table.place(signal, key)
                found.setdefault(place, []).append((key, scalar_reader(signal)))
        for number, slow in enumerate(settings.slow):
            signal = self._table.take(slow.signal, f"slow.{slow.id}")
            place = self._table.place(signal, f"slow.{slow.id}")
            found.setdefault(place, []).append((number, _scaled(slow, signal)))
        return found

    def _counters(self) -> dict[Place, MessageCounter]:
        step = self._samples_per_frame if self._settings.counter_counts == "frames" else 1
        counters: dict[Place, MessageCounter] = {}
        for path in self._settings.counters:
            signal = self._table.find(path, "counters")
            self._table.require_integer(signal, "counters")
            if signal.n_bits < _MIN_COUNTER_BITS:
                raise ConfigError(f"counters: {path} has {signal.n_bits} bits, too few to count")
            counter = MessageCounter(scalar_reader(signal), step << signal.n_bits, step)
            for place in self._places(signal):
                if place in counters:
                    raise ConfigError(f"counters: {path} is the second of message {place[0]}")
                counters[place] = counter
        return counters

    def _frame_samples(self) -> dict[Place, ScalarReader]:
        readers: dict[Place, ScalarReader] = {}
        for path in self._settings.frame_samples:
            signal = self._table.find(path, "frame_samples")
            self._table.require_integer(signal, "frame_samples")
            readers |= dict.fromkeys(self._places(signal), scalar_reader(signal))
        return readers

    def _places(self, signal: DbcSignal) -> list[Place]:
        """Where a signal can be used: a multiplexed message's common signals, in all its parts."""
        message = signal.message
        if signal.multiplexer_ids or message.multiplexer is None:
            return [(message.name, n) for n in signal.multiplexer_ids or (0,)]
        ids = {n for s in message.signals.values() for n in s.multiplexer_ids}
        return [(message.name, n) for n in sorted(ids)]

    def _require_all_or_none(self, given: Mapping[Place, object], key: str) -> None:
        if not given:
            return
        for place in self._waves:
            if place not in given:
                raise ConfigError(
                    f"{key}: message {place[0]} carries waveforms but none of the signals named;"
                    " name one for each such message, or none at all"
                )

    def _require_counter_of_epoch(self, counters: Mapping[Place, object]) -> None:
        path = self._settings.epoch
        if path is None or not counters:
            return
        place = self._table.place(self._table.find(path, "epoch"), "epoch")
        if place not in counters:
            raise ConfigError(
                f'epoch = "{path}": its message has no counter, so that nobody knows from which'
                " sample on it holds; name its counter under counters, or leave epoch out"
            )

    def _require_losses_are_seen(self, counters: Mapping[Place, object]) -> None:
        instants_per_s = self._calibration.rate_hz / self._samples_per_frame
        if not counters and instants_per_s > MAX_INSTANTS_PER_S:
            raise ConfigError(
                f"counters: none is named, and {instants_per_s:.6g} frames a second of each message"
                " are too many to find losses by the clock alone, which can"
                f" {MAX_INSTANTS_PER_S:g}; name the counters, or let the device send fewer"
            )

    def _part(
        self,
        place: Place,
        values: list[tuple[str | int, ScalarReader]],
        counters: Mapping[Place, MessageCounter],
        n_samples: Mapping[Place, ScalarReader],
    ) -> Part:
        return Part(
            name=place[0],
            wave=self._waves.index(place) if place in self._waves else None,
            counter=counters.get(place),
            n_samples=n_samples.get(place),
            values=tuple(values),
            epoch=dict(values).get(EPOCH),
        )

    def _plan_of(self, name: str, messages: dict[int, MessagePlan]) -> MessagePlan:
        message = self._table.messages[name]
        if message.key not in messages:
            multiplexer = message.multiplexer
            reader = scalar_reader(message.signals[multiplexer]) if multiplexer else None
            messages[message.key] = MessagePlan(message, reader)
        return messages[message.key]


def _scaled(slow: CanSlowChannel, signal: DbcSignal) -> ScalarReader:
    if known_unit(signal.unit) != slow.unit:
        raise ConfigError(
            f'slow.{slow.id}: {signal.path} has unit "{signal.unit}" in the DBC; needed is'
            f" {spellings(slow.unit)}"
        )
    read, scale, offset = scalar_reader(signal), signal.scale, signal.offset
    return lambda data: read(data) * scale + offset
