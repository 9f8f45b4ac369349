"""Lost samples are told of by whoever analyses their unit, and by nobody else."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from core.alarms.alarm import PLANT, Alarm, AlarmChange, AlarmIdentity, AlarmNews, changed
from core.alarms.statistics import ChatterRule
from core.limits import AlarmLevel
from service.cluster.ownership import Partition
from service.cluster.replica_state import ReplicaAlarms
from service.measuring.alarm_engine import AlarmEngine, alarm_engine
from service.measuring.service_alarms import ServiceHealth
from service.settings.loading import load_plant_file
from service.settings.storage import Origin
from service.store.sqlite import SqliteStore

LOST = Alarm(AlarmIdentity(PLANT, "U2", "samples_lost"))


async def test_a_standing_alarm_goes_on_with_the_process_of_its_unit(
    deploy: Path, tmp_path: Path, stepped_clock: Any
) -> None:
    plant = load_plant_file(deploy / "demo.toml")
    raised = replace(LOST, level=AlarmLevel.ALERT, occurrence=1)
    raised, event = changed(LOST, raised, AlarmChange.RAISED, stepped_clock.now_ns())
    with closing(SqliteStore(tmp_path / "padwatch.sqlite3")) as store:
        store.append([], [], [AlarmNews(raised, (event,))])

        async def begun(share: str) -> AlarmEngine:
            part = Partition.of(share)
            return await alarm_engine(
                part.part_of(plant),
                Origin.LIVE,
                store,
                lambda _: None,
                stepped_clock,
                look=ServiceHealth,
                part=part.share_of(plant),
            )

        standing = {
            share: [alarm.identity.id for alarm in (await begun(share)).alarms if alarm.level]
            for share in ("1/2", "2/2")
        }

    assert standing == {"1/2": [], "2/2": [LOST.identity.id]}


def test_a_replica_asks_the_process_of_the_unit() -> None:
    replica = ReplicaAlarms(["U1", "U2"], lambda _: True, ChatterRule())
    replica.take_stored([LOST])
    assert replica.owner(LOST.identity.id) == "U2"
