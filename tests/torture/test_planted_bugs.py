"""Bugs that are planted in one part: what the part promises is tried with the bug and without."""

import asyncio
import struct
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, closing
from pathlib import Path

import pytest
from fastapi import APIRouter
from harness.deeds import Build

from acquisition.errors import FrameError, LinkError
from acquisition.modbus import framing
from acquisition.modbus.link import ModbusLink
from acquisition.modbus.ring_source import ModbusRingSettings
from acquisition.modbus.transport import TcpTransport
from core.assessment import Assessment
from service.api.access.application import GuardedApi
from service.api.access.declared import OPEN, UndeclaredRouteError
from service.heartbeats import UNHEARD, Pulse
from service.live import LinkState, LiveView
from service.recorder import Findings, Recorder
from service.store import sql_store
from service.store.port import StoreError, TrendQuery
from service.store.sql_store import SqlStore
from service.store.sqlite import SqliteStore

PATIENCE_S = 30.0
GIVEN_UP_S = 0.5
"""How long what is wrong is waited for before it is believed never to come."""

MBAP = struct.Struct(">HHHB")
Patch = pytest.MonkeyPatch


class WallClock:
    """A clock that somebody sets; its steady side does not notice."""

    def __init__(self) -> None:
        self.passed_s, self.stepped_s = 0.0, 0.0

    def now_ns(self) -> int:
        return round((1_767_225_600 + self.passed_s + self.stepped_s) * 1e9)

    def monotonic_s(self) -> float:
        return self.passed_s

    async def sleep(self, duration_s: float) -> None:
        self.passed_s += duration_s
        await asyncio.sleep(0)


# --- a wake-up that gets lost between two findings ------------------------------------------


class Gated(SqlStore):
    """A store that writes when it is let."""

    entered: threading.Event
    let: threading.Event

    def append(self, *args: object, **options: object) -> None:
        self.entered.set()
        self.let.wait(PATIENCE_S)
        super().append(*args, **options)  # type: ignore[arg-type]


async def all_that_was_put_is_stored(folder: Path, assessment: Build, within_s: float) -> bool:
    """Whether a finding that comes while another one is written gets to the disk by itself."""
    clock = WallClock()
    with closing(SqliteStore(folder / "padwatch.sqlite3")) as store:
        store.__class__ = type("GatedStore", (Gated, type(store)), {})
        store.entered, store.let = threading.Event(), threading.Event()
        recorder = Recorder(store, LiveView(["U1"], clock, 60.0), clock)
        running = asyncio.create_task(recorder.run())
        recorder.put(Findings([assessment(clock.now_ns())]))
        await asyncio.to_thread(store.entered.wait, PATIENCE_S)
        recorder.put(Findings([assessment(clock.now_ns() + 1)]))
        store.let.set()
        try:
            async with asyncio.timeout(within_s):
                await recorder.settled()
        except TimeoutError:
            pass
        running.cancel()
        await asyncio.wait([running])
        query = TrendQuery("U1", "UJB", ("speed_rpm",), 0, 2**62, 100, 2**62)
        return len(store.trend(query).time_ns) == 2


async def forgetful(self: Recorder, pulse: Pulse = UNHEARD) -> None:
    """The recorder's loop with the wake-up taken back after the work instead of before."""
    while True:
        pulse.rest()
        await self._news.wait()
        await self._write()
        self._news.clear()


async def test_a_finding_that_comes_during_a_write_is_stored_by_itself(
    tmp_path: Path, assessment: Build
) -> None:
    assert await all_that_was_put_is_stored(tmp_path, assessment, PATIENCE_S)


@pytest.mark.planted("wake-up lost in the recorder's queue")
async def test_a_lost_wake_up_is_found_out(
    tmp_path: Path, assessment: Build, monkeypatch: Patch
) -> None:
    monkeypatch.setattr(Recorder, "run", forgetful)
    assert not await all_that_was_put_is_stored(tmp_path, assessment, GIVEN_UP_S)


# --- deadlines by a clock that can be set ----------------------------------------------------


def old_is_shown_after_a_step(clock: WallClock, result: Assessment) -> bool:
    """Whether an old result passes for current once the host's clock has been put back."""
    live = LiveView(["U1"], clock, stale_after_s=30.0)
    live.set_link("U1", LinkState.CONNECTED)
    live.set_assessment(result)
    clock.passed_s += 100.0
    clock.stepped_s -= 3600.0
    return live.current("U1", "UJB").is_current


def test_a_clock_that_is_put_back_makes_nothing_current_again(assessment: Build) -> None:
    assert not old_is_shown_after_a_step(WallClock(), assessment())


@pytest.mark.planted("deadlines by the wall clock")
def test_deadlines_by_the_wall_clock_are_found_out(assessment: Build, monkeypatch: Patch) -> None:
    monkeypatch.setattr(WallClock, "monotonic_s", lambda clock: clock.now_ns() / 1e9)
    assert old_is_shown_after_a_step(WallClock(), assessment())


# --- a gateway that mixes up its answers -----------------------------------------------------


@asynccontextmanager
async def mixed_up_gateway() -> AsyncIterator[int]:
    """Registers that hold their own address, behind a gateway that answers another request."""
    ended = asyncio.Event()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while head := await reader.read(MBAP.size):
            tid, _, length, unit = MBAP.unpack(head)
            pdu = await reader.readexactly(length - 1)
            address, count = struct.unpack(">HH", pdu[1:5])
            values = struct.pack(f">{count}H", *range(address + 1, address + 1 + count))
            reply = bytes([pdu[0], 2 * count]) + values
            writer.write(MBAP.pack((tid - 1) % 2**16, 0, len(reply) + 1, unit) + reply)
        writer.close()
        await writer.wait_closed()
        ended.set()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[1]
        await ended.wait()
    finally:
        server.close()


async def wrong_registers_are_taken() -> bool:
    """Whether the answer to another request passes for the one to this."""
    async with mixed_up_gateway() as port:
        link = ModbusLink(ModbusRingSettings(transport=TcpTransport(host="127.0.0.1", port=port)))
        await link.open()
        try:
            data = await link.read(100, 4)
        except (LinkError, FrameError):
            return False
        finally:
            link.close()
    return data != struct.pack(">4H", *range(100, 104))


async def test_the_answer_to_another_request_is_refused() -> None:
    assert not await wrong_registers_are_taken()


@pytest.mark.planted("transaction id of replies unchecked")
async def test_an_unchecked_transaction_id_is_found_out(monkeypatch: Patch) -> None:
    require = framing._require_equal

    def careless(name: str, value: int, expected: int) -> None:
        if name != "transaction id":
            require(name, value, expected)

    monkeypatch.setattr(framing, "_require_equal", careless)
    assert await wrong_registers_are_taken()


# --- a route that nobody guards --------------------------------------------------------------


def starts_with(dependencies: list[object]) -> bool:
    """Whether an application with such a route starts."""
    app = GuardedApi(openapi_url=None)
    router = APIRouter()
    router.add_api_route("/keys", lambda: None, methods=["DELETE"], dependencies=dependencies)  # type: ignore[arg-type]
    app.include_router(router)
    try:
        app.require_declarations()
    except UndeclaredRouteError:
        return False
    return True


@pytest.mark.planted("route without its access dependency")
def test_a_route_that_nobody_guards_is_found_out() -> None:
    assert starts_with([OPEN])
    assert not starts_with([])


# --- the same result twice -------------------------------------------------------------------


def is_kept_once(folder: Path, assessment: Callable[..., Assessment]) -> bool:
    """Whether what is written again, as after an answer that got lost, is taken for what it is."""
    with closing(SqliteStore(folder / "padwatch.sqlite3")) as store:
        one = assessment(speed_rpm=92.3)
        try:
            store.append([one], [])
            store.append([one], [])
        except StoreError:
            return False
        query = TrendQuery("U1", "UJB", ("speed_rpm",), 0, 2**62, 100, 2**62)
        return len(store.trend(query).time_ns) == 1


@pytest.mark.planted("insert without ON CONFLICT")
def test_a_result_that_cannot_be_written_again_is_found_out(
    tmp_path: Path, assessment: Build, monkeypatch: Patch
) -> None:
    assert is_kept_once(tmp_path / "sound", assessment)
    insert = sql_store.INSERT_ASSESSMENT.partition("ON CONFLICT")[0]
    monkeypatch.setattr(sql_store, "INSERT_ASSESSMENT", insert)
    assert not is_kept_once(tmp_path / "planted", assessment)
