"""What a faulty device answers to a request it has understood."""

from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from acquisition.simulated.devices.answers import refusal

Answerer: TypeAlias = Callable[[bytes], bytes]
ReplyFault: TypeAlias = Callable[[bytes, Answerer], bytes | None]
"""Takes a request and who answers it rightly; gives what is answered, None for silence."""

_DEVICE_FAILURE, _BUSY = 4, 6
_EXCEPTION_CODES = (1, 2, 3, 4, 5, 6, 8, 10, 11)
_REGISTER_FUNCTIONS = (3, 4)


class HangUpError(Exception):
    """The device closes the connection instead of answering."""


def silent(request: bytes, answerer: Answerer) -> None:
    """Never answer."""


def hanging_up(request: bytes, answerer: Answerer) -> bytes:  # noqa: ARG001
    """Close the connection."""
    raise HangUpError


def refusing(code: int) -> ReplyFault:
    """Answer with an exception."""
    return lambda request, _: refusal(request[0], code)


def shifted_map(request: bytes, answerer: Answerer) -> bytes:
    """Answer with what lies one register further, as after a change of firmware."""
    address = int.from_bytes(request[1:3], "big") + 1
    return answerer(request[:1] + (address & 0xFFFF).to_bytes(2, "big") + request[3:])


def swapped_words(request: bytes, answerer: Answerer) -> bytes:
    """Exchange the two words of each doubleword of a register reply."""
    reply = answerer(request)
    n_pairs = (len(reply) - 2) // 4
    if reply[0] not in _REGISTER_FUNCTIONS or not n_pairs:
        return reply
    words = np.frombuffer(reply, ">u2", 2 * n_pairs, 2).reshape(n_pairs, 2)
    return reply[:2] + words[:, ::-1].tobytes() + reply[2 + 4 * n_pairs :]


REPLY_FAULTS: Mapping[str, ReplyFault] = {
    "busy": refusing(_BUSY),
    "cut": hanging_up,
    "exception": refusing(_DEVICE_FAILURE),
    **{f"exception_{code}": refusing(code) for code in _EXCEPTION_CODES},
    "shift_map": shifted_map,
    "silent": silent,
    "word_order": swapped_words,
}
