"""A CAN bus at whose other end a test stands."""

import queue
import threading

import can

from acquisition.simulated.devices.can_server import can_message

VIRTUAL = {"interface": "virtual", "channel": "a test's own bus"}


class FakeBus(can.BusABC):
    """A bus at whose other end a test stands."""

    def __init__(self) -> None:
        self.messages: queue.SimpleQueue = queue.SimpleQueue()
        self.failure: Exception | None = None
        self.on_shutdown: Exception | None = None
        self.n_shutdowns = 0
        self.can_state = can.BusState.ACTIVE
        super().__init__("fake")

    def _recv_internal(self, timeout):
        if self.failure is not None:
            raise self.failure
        try:
            message = self.messages.get(block=timeout != 0, timeout=timeout)
        except queue.Empty:
            return None, True
        if isinstance(message, Exception):
            raise message
        return message, True

    def send(self, msg, timeout=None):  # noqa: ARG002
        raise AssertionError("padwatch has sent a frame")

    @property
    def state(self):
        return self.can_state

    def shutdown(self) -> None:
        self.n_shutdowns += 1
        super().shutdown()
        if self.on_shutdown is not None:
            raise self.on_shutdown


def can_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("can ")]


def send_block(device, fake_bus) -> None:
    device.produce()
    for frame in device.next_frames():
        fake_bus.messages.put(can_message(frame))
