"""What the API says of recordings, and hands out of them."""

import csv
import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from rigs.capturing import BLOCK, block, recorded_unit

from acquisition.recordings.reader import open_recording
from acquisition.recordings.writer import RecordingWriter

RECORDINGS = "/api/v1/recordings"
Keep = Callable[..., Path]


@pytest.fixture
def keep(capture: Keep) -> Keep:
    """Puts a recording of some blocks where captures are; the fourth block is missing."""

    def make(at_s: int, unit: str = "U1", lost: bool = False) -> Path:
        blocks = [block(n, unit, lost and n == 1) for n in (0, 1, 2, 4)]
        recorded = recorded_unit(unit)
        return capture(unit, blocks, lambda to, by: RecordingWriter(to, recorded, by), at_s)

    return make


async def test_recordings_are_listed_with_what_they_are_for(service, keep):
    assert (await service.json(RECORDINGS))["recordings"] == []
    await service.problem(f"{RECORDINGS}/U1-20260101T000000.000Z-shaft_x", 404)
    first, second = keep(10).name, keep(20, "U2").name

    body = await service.json(RECORDINGS)
    of_one = await service.json(RECORDINGS, unit="U1")

    assert {each["id"] for each in body["recordings"]} == {first, second}
    assert (body["being_made"], body["error"]) == ([], None)
    [one] = of_one["recordings"]
    assert (one["id"], one["state"], one["unit"]) == (first, "complete", "U1")
    assert (one["n_samples"], one["rate_hz"], one["duration_s"]) == (40, 50.0, 0.8)
    assert one["start"].startswith("2026-01-01T00:00:00.000")
    assert one["alarms"] == [
        {
            "alarm": f"U1:UJB:{'order1_shaft_x'}",
            "occurrence": 1,
            "change": "raised",
            "level": "alert",
            "time": "2026-01-01T00:00:10.000Z",
        }
    ]
    assert len((await service.json(RECORDINGS, limit=1))["recordings"]) == 1
    await service.problem(RECORDINGS, 404, unit="U9")


async def test_a_recording_has_holes_and_checksums_and_its_samples_as_csv(service, keep):
    folder = keep(10, lost=True)

    body = await service.json(f"{RECORDINGS}/{folder.name}")

    assert body["recording"]["id"] == folder.name
    assert (body["n_gaps"], body["n_gap_samples"], body["epochs"]) == (1, BLOCK, [1])
    assert body["end"] == "2026-01-01T00:00:01.000Z"
    assert (body["channels"], body["n_not_ok"]) == ({"a": "um", "b": "um"}, {"a": BLOCK})

    response = await service.get(f"{RECORDINGS}/{folder.name}/samples.csv")

    assert response.headers["content-disposition"] == f'attachment; filename="{folder.name}.csv"'
    rows = list(csv.DictReader(io.StringIO(response.text)))
    assert [int(row["index"]) for row in rows] == [*range(30), *range(40, 50)]
    assert [float(row["b [um]"]) for row in rows] == [-float(row["index"]) for row in rows]
    lost = [row["index"] for row in rows if row["a [um]"] == "nan"]
    assert lost == [str(index) for index in range(BLOCK, 2 * BLOCK)]


async def test_the_files_of_a_recording_arrive_whole(service, keep, tmp_path):
    folder = keep(10)

    response = await service.get(f"{RECORDINGS}/{folder.name}/files.zip")

    assert response.headers["content-type"] == "application/zip"
    with zipfile.ZipFile(io.BytesIO(response.content)) as archive:
        archive.extractall(tmp_path / "taken")
    taken = open_recording(tmp_path / "taken" / folder.name)
    numbers = [int(value) for raw in taken.blocks() for value in raw.counts[0]]
    assert numbers == [*range(30), *range(40, 50)]


async def test_a_damaged_recording_is_said_to_be_and_shows_no_path(service, keep, tmp_path):
    whole, cut = keep(10), keep(20)
    (cut / "manifest.json").write_text("{")
    samples = whole / "samples.parquet"
    samples.write_bytes(samples.read_bytes()[:-1] + b"x")

    body = await service.json(RECORDINGS)

    states = {each["id"]: each for each in body["recordings"]}
    assert states[cut.name]["state"] == "damaged"
    assert str(tmp_path) not in states[cut.name]["reason"]
    for path in (f"{cut.name}", f"{whole.name}", f"{whole.name}/samples.csv"):
        problem = await service.problem(f"{RECORDINGS}/{path}", 410)
        assert str(tmp_path) not in problem["detail"]


async def test_no_name_leads_out_of_the_folder_of_recordings(service, keep, tmp_path):
    folder = keep(10)
    (tmp_path / "captures" / "link").symlink_to(tmp_path)
    unfinished = folder.with_name(f"{folder.name}-2.incomplete")
    unfinished.mkdir()

    for name in ("%2e%2e", "..%2f..%2fpasswd", "link", "U1", unfinished.name, "a" * 121, "-x"):
        for what in ("", "/files.zip", "/samples.csv"):
            response = await service.get(f"{RECORDINGS}/{name}{what}")
            assert response.status_code in (404, 422), f"{name}{what}"
    assert len((await service.json(RECORDINGS))["recordings"]) == 1


async def test_a_bit_that_flips_in_what_a_recording_was_made_for_hides_it(service, keep):
    path = keep(10) / "alarm.json"
    path.write_text(path.read_text().replace('"occurrence": 1', '"occurrence": 3'))

    [one] = (await service.json(RECORDINGS))["recordings"]
    assert one["alarms"] == []
