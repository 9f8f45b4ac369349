"""Reports that cannot be applied in full: what is known is shown, and the rest is not."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

from service.live.client import LiveClient
from service.live.snapshot import Report, UnitLink, UnitReport, UnitSnapshot
from service.live.status import LinkState, UnitStatus
from service.measuring.snapshots import bearing_snapshot
from service.settings.plant import load_plant_file
from service.store.sqlite import SqliteStore

PLANT = load_plant_file(Path(__file__).parents[3] / "deploy" / "demo.toml")
UNIT = PLANT.unit[0].id
BEARING = PLANT.unit[0].bearing[0].id


async def test_a_baseline_that_cannot_be_read_hides_no_result(assessment, stepped_clock, tmp_path):
    found = replace(assessment(), unit=UNIT, bearing=BEARING)
    bearings = {BEARING: bearing_snapshot(found)}
    snapshot = UnitSnapshot(bearings, (), frozenset(), frozenset(), {}, {BEARING: 2})
    link = UnitLink(UnitStatus(LinkState.CONNECTED), 0.0, {BEARING: 0.0}, 0.0)
    report = Report("one", 1, (UnitReport(UNIT, link, 1, snapshot),), None)
    path = tmp_path / "data" / "padwatch.sqlite3"
    with closing(SqliteStore(path)) as store:
        client = LiveClient(PLANT, store.films, stepped_clock)
        path.rename(tmp_path / "elsewhere")
        await client.take(report, is_direct=True)

    assert client.units.current(UNIT, BEARING).is_current
    assert client.films.baseline(UNIT, BEARING) is None

    found = SimpleNamespace(origin=SimpleNamespace(version=2))
    client.films._store = SimpleNamespace(
        baseline=lambda *which: which == (UNIT, BEARING, 2) and found
    )
    await client.take(replace(report, number=2), is_direct=True)
    assert client.films.baseline(UNIT, BEARING) is found
