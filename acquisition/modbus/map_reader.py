"""`MapReader`: reads a register map over an open link, poll by poll."""

from acquisition.errors import ConfigError
from acquisition.modbus.cells import BIT_FUNCTIONS, reads_as
from acquisition.modbus.decoding import CellDecoder, MapDecoder, MapReading
from acquisition.modbus.link import ModbusLink
from acquisition.modbus.read_plan import ReadPlan, plan_signature


class MapReader:
    """One device's map. One request is outstanding at a time, and none is repeated."""

    def __init__(self, link: ModbusLink, decoder: MapDecoder) -> None:
        self._link, self._decoder = link, decoder

    async def read(self) -> MapReading:
        """Read everything once; from the right device, also if connections are not kept.

        Raises
        ------
        LinkError, FrameError, ConfigError
            As the link does.
        """
        if not self._link.is_kept:
            await self._link.require_device()
            await self.require_signature()
        return self._decoder.read(await self.content())

    async def content(self) -> bytes:
        """All replies, one after the other."""
        return await self._replies(self._decoder.plan)

    async def require_signature(self) -> None:
        """Refuse a device that is another one than configured.

        Raises
        ------
        ConfigError
            Naming register, what was found and what was expected.
        """
        signature = self._decoder.map.signature
        plan = plan_signature(self._decoder.map)
        decoder = CellDecoder([s.cell for s in signature], plan)
        found = decoder.numbers(await self._replies(plan))
        for part, number in zip(signature, found.tolist(), strict=True):
            if not reads_as(number, part.cell.type, part.expected):
                raise ConfigError(
                    f"{self._link.where}: another device than configured: register"
                    f" {part.cell.address} is {number:g}, expected {part.expected:g}"
                )

    async def _replies(self, plan: ReadPlan) -> bytes:
        replies = []
        for request in plan.requests:
            read = self._link.read_bits if request.function in BIT_FUNCTIONS else self._link.read
            replies.append(await read(request.start, request.count, request.function))
        return b"".join(replies)
