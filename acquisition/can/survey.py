"""`Survey`: what passes on a bus, message by message, before anything is configured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from acquisition.can.dbc import DbcMessage, DbcSignal, frame_key
from acquisition.can.layout import FrameLayout
from acquisition.errors import FrameError

_KEPT = 5000
"""Frames of each id that are kept to be decoded."""

_SHOWN_BYTES = 8
_INT16_BYTES = 2


class SurveyedMessage(Protocol):
    """The part of python-can's message that is looked at."""

    arbitration_id: int
    is_extended_id: bool
    is_remote_frame: bool
    is_error_frame: bool
    is_fd: bool
    data: bytearray


@dataclass(frozen=True)
class Span:
    """Least and greatest of the finite values seen; None if there was none."""

    name: str
    minimum: float | None
    maximum: float | None
    unit: str = ""


@dataclass(frozen=True)
class WordGuess:
    """Two bytes as a signed 16-bit number in both orders.

    Parameters
    ----------
    smoother
        The order in which the values change less from frame to frame: "little" or "big"; none if
        they do not change or there is nothing to choose.
    """

    offset: int
    little: Span
    big: Span
    smoother: str


@dataclass(frozen=True)
class MessageLook:
    """One id as it was seen.

    Parameters
    ----------
    lengths
        All lengths of data that occurred.
    name
        Of the DBC's message; empty if it has none for this id, or of another kind or length.
    misfit
        How frame and DBC's message differ.
    """

    frame_id: int
    extended: bool
    fd: bool
    n_frames: int
    frames_per_s: float
    lengths: tuple[int, ...]
    first_bytes: str
    name: str
    misfit: str
    signals: tuple[Span, ...]
    words: tuple[WordGuess, ...]


@dataclass(frozen=True)
class BusLook:
    """All that was seen in a time.

    Parameters
    ----------
    n_malformed
        Lines or messages that are no CAN frame, as those of an slcan adapter that appends times.
    not_seen
        Messages of the DBC that did not come.
    """

    duration_s: float
    messages: tuple[MessageLook, ...]
    n_remote: int
    n_error: int
    n_malformed: int
    not_seen: tuple[str, ...]


@dataclass
class _Heard:
    n_frames: int = 0
    fd: bool = False
    lengths: set[int] = field(default_factory=set)
    kept: list[bytes] = field(default_factory=list)


class Survey:
    """Collects frames.

    Parameters
    ----------
    messages
        Of a DBC, by name; none if there is no DBC.
    """

    def __init__(self, messages: Mapping[str, DbcMessage]) -> None:
        self._messages = {message.key: message for message in messages.values()}
        self._heard: dict[tuple[int, bool], _Heard] = {}
        self._n_remote = self._n_error = self._n_malformed = 0

    def add_malformed(self, n_malformed: int) -> None:
        """Take in that something came that is no frame."""
        self._n_malformed += n_malformed

    def add(self, message: SurveyedMessage) -> None:
        """Take a frame in."""
        if message.is_error_frame:
            self._n_error += 1
            return
        if message.is_remote_frame:
            self._n_remote += 1
            return
        place = (message.arbitration_id, message.is_extended_id)
        heard = self._heard.setdefault(place, _Heard())
        heard.n_frames += 1
        heard.fd |= message.is_fd
        heard.lengths.add(len(message.data))
        if len(heard.kept) < _KEPT:
            heard.kept.append(bytes(message.data))

    def look(self, duration_s: float) -> BusLook:
        """Everything seen, by id."""
        looks = [
            self._look(frame_id, extended, heard, duration_s)
            for (frame_id, extended), heard in sorted(self._heard.items())
        ]
        seen = {frame_key(frame_id, extended) for frame_id, extended in self._heard}
        return BusLook(
            duration_s=duration_s,
            messages=tuple(looks),
            n_remote=self._n_remote,
            n_error=self._n_error,
            n_malformed=self._n_malformed,
            not_seen=tuple(m.name for key, m in self._messages.items() if key not in seen),
        )

    def _look(self, frame_id: int, extended: bool, heard: _Heard, duration_s: float) -> MessageLook:
        message = self._messages.get(frame_key(frame_id, extended))
        misfit = self._misfit(frame_id, extended, heard)
        decodable = message is not None and not misfit
        same_length = [data for data in heard.kept if len(data) == len(heard.kept[0])]
        return MessageLook(
            frame_id=frame_id,
            extended=extended,
            fd=heard.fd,
            n_frames=heard.n_frames,
            frames_per_s=heard.n_frames / duration_s,
            lengths=tuple(sorted(heard.lengths)),
            first_bytes=heard.kept[-1][:_SHOWN_BYTES].hex(" ").upper(),
            name=message.name if message else "",
            misfit=misfit,
            signals=_spans(message, heard.kept) if message and decodable else (),
            words=() if decodable else _guesses(same_length),
        )

    def _misfit(self, frame_id: int, extended: bool, heard: _Heard) -> str:
        message = self._messages.get(frame_key(frame_id, extended))
        if message is None:
            twin = self._messages.get(frame_key(frame_id, not extended))
            kind = "an extended" if twin and twin.extended else "a standard"
            return f"the DBC has {twin.name} with {kind} id" if twin else ""
        if heard.fd != message.fd:
            kind = "CAN FD" if message.fd else "classic"
            return f"the DBC says {kind}, by its attribute VFrameFormat"
        if heard.lengths != {message.length}:
            return f"the DBC says {message.length} bytes"
        return ""


def _spans(message: DbcMessage, frames: Sequence[bytes]) -> tuple[Span, ...]:
    spans = []
    for signal in message.signals.values():
        values = _values(message, signal, frames)
        if len(values):
            scaled = values * signal.scale + signal.offset
            spans.append(_span(scaled[np.isfinite(scaled)], signal.name, signal.unit))
    return tuple(spans)


def _values(
    message: DbcMessage, signal: DbcSignal, frames: Sequence[bytes]
) -> npt.NDArray[np.float64]:
    if message.multiplexer is None:
        return np.asarray(FrameLayout(message, [signal]).columns(frames)[signal.name], np.float64)
    values = []
    for data in frames:
        try:
            values.append(float(message.raw_value(signal.name, data)))
        except FrameError:  # the DBC does not know this value of the multiplexer
            continue
    return np.array(values)


def _guesses(frames: Sequence[bytes]) -> tuple[WordGuess, ...]:
    """Every two bytes as numbers; the true order of a waveform is the smoother one."""
    length = len(frames[0])
    guesses = []
    for offset in range(0, length - 1, _INT16_BYTES):
        words = b"".join(data[offset : offset + _INT16_BYTES] for data in frames)
        little = np.frombuffer(words, "<i2").astype(np.int64)
        big = np.frombuffer(words, ">i2").astype(np.int64)
        guesses.append(WordGuess(offset, _span(little), _span(big), _smoother(little, big)))
    return tuple(guesses)


def _smoother(little: npt.NDArray[np.int64], big: npt.NDArray[np.int64]) -> str:
    rough_little, rough_big = (float(np.abs(np.diff(v)).sum()) for v in (little, big))
    if rough_little == rough_big:
        return ""
    return "little" if rough_little < rough_big else "big"


def _span(values: npt.NDArray[Any], name: str = "", unit: str = "") -> Span:
    if not len(values):
        return Span(name, None, None, unit)
    return Span(name, float(values.min()), float(values.max()), unit)
