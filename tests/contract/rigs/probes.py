"""A probe that fails and works again, and what people ask the API to do about it."""

import asyncio
from collections.abc import Sequence
from typing import Any

import httpx2
import numpy as np

from core.monitor.assessment import Assessment
from core.quality import GOOD, Reading, Reason, bad
from rigs.blocks import given_block

ALARMS = "/api/v1/alarms"
PROBE = "U1:ujb_shaft_x:channel_not_ok"
ACKNOWLEDGE = f"{ALARMS}/{PROBE}/acknowledge"
SHELVE = f"{ALARMS}/{PROBE}/shelve"
ANNA = {"actor": "A. Name"}


class Probes:
    """Blocks of unit U1, in which the first probe may have failed."""

    def __init__(self, service: Any) -> None:
        self._service = service
        self.n_blocks = 0
        service.alarms.link("U1", True)

    def send(
        self, n_blocks: int, reason: Reason = Reason.OK, results: Sequence[Assessment] = ()
    ) -> None:
        """Let blocks come, and with each of them some results."""
        for _ in range(n_blocks):
            self._take(bad(reason) if reason is not Reason.OK else GOOD, results)

    def _take(self, first_probe: Any, results: Sequence[Assessment]) -> None:
        start = self.n_blocks
        self.n_blocks += 1
        block = given_block(
            unit="U1",
            epoch=1,
            first_index=start * 600,
            start_ns=1_767_225_600_000_000_000 + start * 1_000_000_000,
            rate_hz=600.0,
            samples=np.zeros((12, 600), dtype=np.float32),
            channel_quality=(first_probe,) + (GOOD,) * 11,
            slow={"speed": Reading(92.3)},
        )
        news = self._service.alarms.take(block, results)
        if news:
            self._service.recorder.put(news)

    async def stored(self) -> None:
        """Wait until all news are on the disk."""
        await asyncio.wait_for(self._service.recorder.stored(), 30)


async def post(service: Any, path: str, body: Any, **headers: str) -> httpx2.Response:
    """Ask the API to do something."""
    response: httpx2.Response = await service.client.post(path, json=body, headers=headers)
    return response
