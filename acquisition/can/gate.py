"""Filter for frames of configured messages with correct length; interpreter of error frames."""

from typing import TypeAlias

from can import Message

from acquisition.can.dbc import frame_key
from acquisition.can.plan import Plan, Refusal, RefusalCounts
from acquisition.errors import LinkError

Frame: TypeAlias = tuple[int, bytes | None]
"""Frame key and data; the data is None for a frame of wrong length."""


class FrameGate:
    """Filter that admits frames of configured messages and counts refused frames by reason.

    `refused` are the counts of refused frames, which are updated in place.
    """

    def __init__(self, plan: Plan, refused: RefusalCounts) -> None:
        self._shapes = {
            key: (message_plan.message.length, message_plan.message.fd)
            for key, message_plan in plan.messages.items()
        }
        self._refused = refused

    def admit(self, message: Message) -> Frame | None:
        """Return key and data of a frame of a configured message; None for any other frame.

        The data is None if the frame has a wrong length.
        """
        key = frame_key(message.arbitration_id, message.is_extended_id)
        shape = self._shapes.get(key)
        if shape is None or message.is_error_frame:
            self._refused[self._why_foreign(message)] += 1
            return None
        length, fd = shape
        if message.is_remote_frame:
            self._refused[Refusal.REMOTE] += 1
            return None
        if message.is_fd != fd:
            self._refused[Refusal.FD if message.is_fd else Refusal.CLASSIC] += 1
            return None
        if message.dlc != length or len(message.data) != length:
            self._refused[Refusal.WRONG_LENGTH] += 1
            return key, None
        return key, bytes(message.data)

    def _why_foreign(self, message: Message) -> Refusal:
        if message.is_error_frame:
            return Refusal.ERROR
        twin = frame_key(message.arbitration_id, not message.is_extended_id)
        return Refusal.OTHER_ID_KIND if twin in self._shapes else Refusal.FOREIGN


BUS_OFF = 0x40
CONTROLLER = 0x04
PROTOCOL = 0x08
BUS_ERROR = 0x80
RX_OVERFLOW = 0x01
RX_PASSIVE, TX_PASSIVE = 0x10, 0x20

_CONTROLLER_BYTE = 1


def require_bus(message: Message, where: str) -> None:
    """Check that an error frame reports neither a bus-off nor an error-passive controller.

    `where` is the name of the bus in error messages. Raises LinkError if the controller is bus-off
    or error-passive; the received frames are then incomplete.
    """
    if message.arbitration_id & BUS_OFF:
        raise LinkError(
            f"{where}: the CAN controller is bus-off; check bit rate, wiring and termination"
        )
    if _controller_state(message) & (RX_PASSIVE | TX_PASSIVE):
        raise LinkError(
            f"{where}: the CAN controller is error-passive; check bit rate and termination"
        )


def lost_in_controller(message: Message) -> bool:
    """Return whether an error frame reports a receive overflow in the controller."""
    return bool(_controller_state(message) & RX_OVERFLOW)


def _controller_state(message: Message) -> int:
    has_state = message.arbitration_id & CONTROLLER and len(message.data) > _CONTROLLER_BYTE
    return message.data[_CONTROLLER_BYTE] if has_state else 0
