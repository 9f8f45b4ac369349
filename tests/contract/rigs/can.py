"""CAN sources on a counting plant, behind a real slcan adapter on a TCP port."""

from contextlib import AsyncExitStack
from dataclasses import replace

from acquisition.can.settings import CanLinkSettings
from acquisition.can.source import CanSource
from acquisition.clock import SystemClock
from acquisition.simulated.devices.can_device import CanDevice
from acquisition.simulated.devices.can_shape import CanShape, DaqSignal, daq_settings
from acquisition.simulated.devices.can_slcan import SlcanTcpServer
from acquisition.source import SampleSource


def shape_of(calibration, fd: bool) -> CanShape:
    """A DAQ with the channels of a calibration, in counts."""
    channels = [
        DaqSignal(f"channel{n}", "V", channel.full_scale_v / 32768)
        for n, channel in enumerate(calibration.channels)
    ]
    slow = [DaqSignal(slow.id, "degC") for slow in calibration.slow]
    return CanShape(channels=tuple(channels), slow=tuple(slow), fd=fd)


class CanRig:
    """Classic CAN frames; the plant runs when told."""

    fd = False
    absence = "refused"

    def __init__(self, feed, calibration, clock) -> None:  # noqa: ARG002 - sockets have their own
        self._shape = shape_of(calibration, self.fd)
        self._device = CanDevice(feed, self._shape)
        self._server = SlcanTcpServer(self._device)
        self._calibration = calibration
        self._plug = AsyncExitStack()
        self.step_samples = self._device.block_samples
        self.source: SampleSource

    async def __aenter__(self) -> "CanRig":
        await self.plug_in()
        link = CanLinkSettings(**self._server.endpoint, fd=self.fd)
        units = ("um",) * len(self._calibration.channels)
        # it sends when a test wants, however busy the machine is: that it does not is no pause
        settings = replace(
            daq_settings(self._shape, link, units), stale_after_s=60.0, when_full="wait"
        )
        self.source = CanSource(settings, self._calibration, SystemClock())
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.pull()

    async def plug_in(self) -> None:
        await self._plug.enter_async_context(self._server)

    async def pull(self) -> None:
        await self._plug.aclose()

    def run(self, n_samples: int) -> None:
        self._server.produce(n_samples // self.step_samples)


class CanFdRig(CanRig):
    """CAN FD frames with five samples in each."""

    fd = True
