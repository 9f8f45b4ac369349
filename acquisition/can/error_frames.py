"""What error frames say of the bus, in the format of Linux, which other interfaces share.

Bits as in ``linux/can/error.h``.
"""

from acquisition.can.gate import Message
from acquisition.errors import LinkError

BUS_OFF = 0x40
CONTROLLER = 0x04
RESTARTED = 0x100
PROTOCOL = 0x08
BUS_ERROR = 0x80
RX_OVERFLOW = 0x01
RX_PASSIVE, TX_PASSIVE = 0x10, 0x20

_CONTROLLER_BYTE = 1


def require_bus(message: Message) -> None:
    """Refuse to go on when an error frame says that the controller is off the bus, or nearly so.

    Raises
    ------
    LinkError
        If it is bus-off or error-passive; what arrives then cannot be complete.
    """
    if message.arbitration_id & BUS_OFF:
        raise LinkError("the CAN controller is bus-off: wrong bitrate, wiring or termination")
    if _controller_state(message) & (RX_PASSIVE | TX_PASSIVE):
        raise LinkError("the CAN controller is error-passive: too many errors on the bus")


def lost_in_controller(message: Message) -> bool:
    """Whether an error frame says that frames were lost before they could be read."""
    return bool(_controller_state(message) & RX_OVERFLOW)


def _controller_state(message: Message) -> int:
    told = message.arbitration_id & CONTROLLER and len(message.data) > _CONTROLLER_BYTE
    return message.data[_CONTROLLER_BYTE] if told else 0
