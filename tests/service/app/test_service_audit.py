"""A service or a replay that starts: who must log in, what it tells, where it keeps results."""

import asyncio
import json
import threading
from contextlib import asynccontextmanager, closing
from pathlib import Path

import numpy as np
import pytest
from rigs.blocks import given_block

from acquisition.clock import SystemClock
from acquisition.errors import LinkError
from core.quality import GOOD
from core.samples.blocks import DeviceClock, SampleBlock
from service.app.recordings import PlayedOut, replay_folder, replayed_plant
from service.app.service_audit import ServiceTrail
from service.app.serving_process import access_desk
from service.settings.plant import PlantFile, load_plant_file
from service.settings.processes import AccessSettings, TlsSettings
from service.settings.storage import Origin
from service.store.access.audit_entries import AuditEntry
from service.store.access.identities import Role
from service.store.audit import AuditQuery
from service.store.sqlite import SqliteStore


def told(store: SqliteStore) -> list[AuditEntry]:
    return list(reversed(store.audit.entries(AuditQuery())))


async def test_starts_stops_and_a_changed_plant_file_are_told(store, plant):
    renamed = plant.plant.model_copy(update={"name": "another name"})
    for found in (plant, plant, plant.model_copy(update={"plant": renamed})):
        trail = ServiceTrail(found, Origin.LIVE, store.audit, SystemClock())
        await trail.begin()
        await trail.end()
    entries = told(store)

    start, stop = "service.started", "service.stopped"
    changed = "configuration.changed"
    assert [e.action for e in entries] == [start, stop, start, stop, changed, start, stop]
    assert {(e.actor, e.source, e.peer) for e in entries} == {("padwatch", "padwatch", None)}
    assert entries[4].before != entries[4].after
    assert entries[4].after is not None
    assert entries[4].after[1:-1] in (entries[5].after or "")


async def test_a_plant_is_watched_also_where_nothing_can_be_told(store, plant, tmp_path):
    trail = ServiceTrail(plant, Origin.LIVE, store.audit, SystemClock())
    store.close()
    await trail.begin()
    await trail.end()
    with closing(SqliteStore(tmp_path / "padwatch.sqlite3")) as again:
        assert told(again) == []


class OverError(Exception):
    """Ends a loop that has no end."""


class SetClock:
    """A host whose clock is set while somebody sleeps: by so much each time."""

    def __init__(self, *steps_s: float) -> None:
        self._steps_s, self._steady_s, self._wrong_s = list(steps_s), 0.0, 0.0

    def now_ns(self) -> int:
        return round((1.79e9 + self._steady_s + self._wrong_s) * 1e9)

    def monotonic_s(self) -> float:
        return self._steady_s

    async def sleep(self, duration_s: float) -> None:
        if not self._steps_s:
            raise OverError
        self._steady_s += duration_s
        self._wrong_s += self._steps_s.pop(0)
        await asyncio.sleep(0)


async def test_a_clock_that_is_set_is_told_and_one_that_is_slewed_is_not(store, plant):
    clock = SetClock(0.0, 7200.0, 0.01, 0.0, -3600.0, -0.3)
    trail = ServiceTrail(plant, Origin.LIVE, store.audit, clock)
    with pytest.raises(OverError):
        await trail.watch_clock()
    entries = told(store)
    assert {(e.action, e.object, e.actor) for e in entries} == {
        ("clock.stepped", "clock", "padwatch")
    }
    assert [json.loads(e.after or "") for e in entries] == [{"by_s": 7200.0}, {"by_s": -3600.0}]
    assert entries[0].time_ns > entries[1].time_ns


DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"
TLS = TlsSettings(certificate="a.crt", key="a.key")


def plant_with(login: bool = False, **service: object) -> PlantFile:
    plant = load_plant_file(DEMO)
    changed = plant.service.model_copy(update=service)
    access = AccessSettings(login=login)
    return plant.model_copy(update={"service": changed, "access": access})


@pytest.mark.parametrize(
    ("plant", "local_role"),
    [
        (plant_with(), Role.VIEWER),
        (plant_with(host="::1"), Role.VIEWER),
        (plant_with(host="localhost", tls=TLS), Role.VIEWER),
        (plant_with(login=True), None),
        (plant_with(socket="/run/padwatch/http.sock"), None),
        (plant_with(host="0.0.0.0", tls=TLS), None),  # noqa: S104
    ],
)
def test_who_is_on_this_computer_may_read_and_others_log_in(access_store, plant, local_role):
    access_store.accounts.add("anna", Role.ADMIN, "$argon2id$", 0)

    assert access_desk(plant, access_store, SystemClock()).local_role is local_role
    in_demo = access_desk(plant, access_store, SystemClock(), is_demo=True).local_role
    assert in_demo is (None if local_role is None else Role.ADMIN)


async def test_a_token_for_setting_up_is_drawn_only_where_nobody_could_log_in(access_store):
    clock = SystemClock()
    closed = access_desk(plant_with(login=True), access_store, clock)
    plain = access_desk(plant_with(), access_store, clock)
    demo = access_desk(plant_with(), access_store, clock, is_demo=True)

    assert demo.offer_set_up() is None
    for desk in (closed, plain):
        assert desk.offer_set_up() is not None
    access_store.accounts.add("anna", Role.ADMIN, "$argon2id$", 0)
    for desk in (closed, plain):
        assert desk.offer_set_up() is None


def test_a_replay_is_for_this_computer_and_asks_for_logins_as_the_plant_does(tmp_path):
    plant = plant_with(login=True, host="0.0.0.0", tls=TLS)  # noqa: S104
    replayed = replayed_plant(plant, ["U1"], tmp_path)

    assert (replayed.service.host, replayed.service.tls) == ("127.0.0.1", None)
    assert replayed.access.login


NEW_YEAR_NS = 1_767_225_600 * 1_000_000_000


class Standing:
    """A source whose device stands still after some blocks, as a DAQ that has played all."""

    def __init__(self, blocks, refuses: bool = False) -> None:
        self._blocks, self._refuses = blocks, refuses

    @asynccontextmanager
    async def connect(self):
        if self._refuses:
            raise LinkError("the device replies, but the newest sample has not changed")
        yield self._stream()

    async def _stream(self):
        for block in self._blocks:
            yield block
        raise LinkError("the device replies, but the newest sample has not changed")


def block(number: int, clock: DeviceClock | None = None) -> SampleBlock:
    """One sample of one channel, of long ago."""
    samples = np.full((1, 1), number, np.float32)
    return given_block("U1", 1, number, NEW_YEAR_NS, 600.0, samples, (GOOD,), clock=clock)


FIRST, SECOND = block(1), block(2)


async def taken(source) -> list[SampleBlock]:
    async with source.connect() as blocks:
        return [block async for block in blocks]


@pytest.fixture
def over() -> threading.Event:
    """The end of the recording, which has come."""
    event = threading.Event()
    event.set()
    return event


async def test_a_device_that_stands_still_after_its_recording_ends_the_stream_without_a_clock(over):
    assert await taken(PlayedOut(Standing([FIRST, SECOND]), over)) == [FIRST, SECOND]
    assert await taken(PlayedOut(Standing([], refuses=True), over)) == []
    off = DeviceClock(offset_s=-28e6, drift_ppm=5e5, u_drift_ppm=1.0)
    [played] = await taken(PlayedOut(Standing([block(1, off)]), over))
    assert played.clock is None


@pytest.mark.parametrize("refuses", [False, True], ids=["while reading", "when connecting"])
async def test_before_its_end_a_lost_link_is_lost_and_a_daq_that_is_gone_is_not_waited_for(
    over, refuses
):
    daq = Standing([FIRST], refuses)
    with pytest.raises(LinkError, match="has not changed"):
        await taken(PlayedOut(daq, threading.Event()))
    gone = over
    source = PlayedOut(daq, threading.Event(), gone)
    assert await taken(source) == ([] if refuses else [FIRST])


def test_results_of_a_replay_lie_apart_under_what_was_played_and_when(deploy):
    plant = load_plant_file(deploy / "demo.toml")
    folder = replay_folder(plant, [Path("runs/march"), Path("runs/april")], NEW_YEAR_NS)
    assert folder == Path("var/demo/replays/march+april-20260101T000000.000Z")
    played = replayed_plant(plant, ["U2"], folder)
    assert [unit.id for unit in played.unit] == ["U2"]
    assert played.service.data_folder == str(folder)
    assert plant.service.data_folder == "var/demo"
