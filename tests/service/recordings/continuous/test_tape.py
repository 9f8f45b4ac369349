"""All samples of a unit are kept unless the analysis needs the room; what is not is told."""

import pytest
from rigs.capturing import counted_block, numbers, samples
from rigs.standing_clock import StandingClock

from acquisition.recordings.reader import open_recording
from service.app import analysis as pressure
from service.app.analysis import Pressure
from service.measuring.acquirer import Bus
from service.recordings import continuous_recorder as tape
from service.recordings import continuous_recorder as unit_tape
from service.recordings.continuous_recorder import DropReason, last_end


async def test_every_sample_is_in_recordings_that_end_at_multiples_of_their_length(running, root):
    async with running(root) as rig:
        rig.send(20, 120)
    first, second, third = rig.recordings()

    assert samples(first) == numbers(20, 50)
    assert samples(second) == numbers(50, 100)
    assert samples(third) == numbers(100, 120)
    assert first.folder.name == "U1-20260101T000004.000Z-continuous"
    assert first.manifest.sample_type == "int16"
    assert rig.tape.n_written == 1000
    assert not rig.tape.n_dropped.total()


async def test_what_a_part_holds_is_on_the_disk_before_the_recording_is_complete(running, root):
    async with running(root) as rig:
        rig.send(0, 25)
        await rig.until(lambda: rig.tape.n_written == 200)
        [parts] = root.iterdir()
        assert parts.name.endswith(".parts")
        assert sum(not part.name.endswith(".incomplete") for part in parts.iterdir()) == 2
        rig.clock.s = 3.0
        await rig.until(lambda: rig.tape.n_written == 250)  # old enough, if not long enough


async def test_two_units_are_recorded_side_by_side_also_if_their_names_begin_alike(running, root):
    async with running(root, ("pump", "pump-b")) as rig:
        rig.send(0, 20, "pump")
        rig.send(3, 200, "pump-b")  # four recordings, all of which sort behind those of "pump"
        rig.send(0, 9, "fan")
    one, *others = rig.recordings()

    assert (one.manifest.unit, {other.manifest.unit for other in others}) == ("pump", {"pump-b"})
    assert samples(one) == numbers(0, 20)
    assert [number for other in others for number in samples(other)] == numbers(3, 200)
    assert (last_end(root, "pump"), last_end(root, "pump-b")) == ((1, 200), (1, 2000))


@pytest.mark.parametrize("reason", [DropReason.ANALYSIS_BEHIND, DropReason.DISK_FULL])
async def test_samples_that_yield_to_analysis_are_a_hole_with_a_reason(running, root, reason):
    async with running(root) as rig:
        rig.send(0, 10)
        rig.reason = reason
        rig.send(10, 17)
        assert rig.tape.trouble is not None
        rig.reason = None
        rig.send(17, 30)
        rig.clock.s = 61.0
        assert rig.tape.trouble is None
    [recording] = rig.recordings()

    assert samples(recording) == numbers(0, 10) + numbers(17, 30)
    assert recording.summary.rejected == {reason.value: 70}
    assert rig.tape.n_dropped == {reason: 70, DropReason.DISK_REFUSED: 0}


async def test_a_disk_that_does_not_keep_up_costs_samples_and_never_memory(running, root):
    async with running(root) as rig:
        rig.send(0, 10)
        rig.clock.s = tape.MAX_WAIT_S + 1.0  # nothing of it was written meanwhile
        rig.send(10, 13)
        await rig.until(lambda: rig.tape.n_written > 0)
        rig.send(13, 20)
    [recording] = rig.recordings()

    assert samples(recording) == numbers(0, 10) + numbers(13, 20)
    assert recording.summary.rejected == {"disk_slow": 30}


async def test_a_refusing_disk_is_told_and_recording_goes_on_after_it(running, root, monkeypatch):
    class RefusedSegment:
        def __init__(self, *_: object) -> None:
            raise OSError(28, "No space left on device")

    async with running(root) as rig:
        with monkeypatch.context() as patch:
            patch.setattr(unit_tape, "Segment", RefusedSegment)
            rig.send(0, 10)
            await rig.until(lambda: rig.tape.error is not None)
        assert "No space left on device" in rig.tape.trouble
        rig.send(10, 20)
        await rig.until(lambda: rig.tape.error is None)
    [recording] = rig.recordings()

    assert samples(recording) == numbers(10, 20)
    assert recording.summary.rejected == {"disk_refused": 100}
    assert rig.tape.n_dropped[DropReason.DISK_REFUSED] == 100


@pytest.mark.parametrize(
    ("lives", "expected", "missing"),
    [
        pytest.param(
            [[(0, 10), (5, 10), (12, 30)]], [[(0, 10), (12, 30)]], {"gap": 20}, id="within one"
        ),
        pytest.param(
            [[(0, 45), (55, 60)]], [[(0, 45)], [(55, 60)]], {"gap_before": 100}, id="between two"
        ),
        pytest.param(
            [[(0, 20)], [(33, 40)]], [[(0, 20)], [(33, 40)]], {"not_running": 130}, id="an outage"
        ),
        pytest.param(
            [[(0, 20)], [(10, 30)]], [[(0, 20)], [(20, 30)]], {}, id="once more after a restart"
        ),
    ],
)
async def test_a_hole_is_told_by_number_and_reason_and_nothing_is_recorded_twice(
    running, root, lives, expected, missing
):
    for sent in lives:
        async with running(root) as rig:
            for start, stop in sent:
                rig.send(start, stop)
    found = rig.recordings()

    assert [samples(one) for one in found] == [
        [number for span in spans for number in numbers(*span)] for spans in expected
    ]
    summary = found[-1].summary
    gaps = {"gap": summary.n_gap_samples} if summary.gaps else {}
    assert {**summary.rejected, **gaps} == missing


async def test_a_device_that_counts_anew_is_recorded_with_both_epochs(running, root):
    async with running(root) as rig:
        rig.send(10, 20)
        rig.send(20, 30, epoch=2)
    [recording] = rig.recordings()

    assert recording.summary.epochs == (1, 2)
    assert samples(recording) == numbers(10, 30)


async def test_samples_that_turn_out_to_be_no_counts_begin_another_recording(running, root):
    async with running(root) as rig:
        rig.send(0, 12)
        rig.send(12, 20, by=0.25)
    first, second = rig.recordings()

    assert (first.manifest.n_samples, second.manifest.n_samples) == (120, 80)
    assert (first.manifest.sample_type, second.manifest.sample_type) == ("int16", "float32")


async def test_a_part_that_is_damaged_before_it_is_joined_is_set_aside(running, root):
    async with running(root) as rig:
        rig.send(0, 30)
        await rig.until(lambda: rig.tape.n_written == 300)
        [parts] = root.iterdir()
        file = parts / "00001" / "samples.parquet"
        file.write_bytes(b"\0" + file.read_bytes()[1:])
    aside, whole = sorted(root.iterdir(), key=lambda path: not path.name.endswith(".damaged"))

    assert aside.name == "U1-20260101T000000.000Z-continuous-00001.damaged"
    assert samples(open_recording(whole)) == numbers(0, 10) + numbers(20, 30)


async def test_what_another_process_is_writing_of_its_own_units_is_let_alone(running, root):
    theirs = [
        root / f"U2-20260101T000000.000Z-continuous{end}" for end in (".parts", ".incomplete")
    ]
    for folder in theirs:
        folder.mkdir(parents=True)
    async with running(root) as rig:
        rig.send(0, 10)
        await rig.until(lambda: rig.tape.n_written == 100)

    assert all(folder.is_dir() for folder in theirs)


class Plant:
    """A queue to the analysis, a disk, and what others have given up already."""

    def __init__(self) -> None:
        self.clock = StandingClock()
        self.bus = Bus(100, self.clock)
        self.is_full = False
        self.pressure = Pressure(self.bus, lambda: self.is_full)


@pytest.fixture
def plant() -> Plant:
    return Plant()


async def test_blocks_that_wait_long_come_before_recording_until_they_wait_no_more(plant):
    await plant.bus.put(counted_block(0))
    plant.clock.s = pressure.BEHIND_S
    assert plant.pressure.look() is None
    plant.clock.s += 0.1
    assert plant.pressure.look() is DropReason.ANALYSIS_BEHIND

    await plant.bus.get()
    plant.bus.task_done()
    await plant.bus.put(counted_block(1))
    plant.clock.s += 0.5 * pressure.BEHIND_S
    assert plant.pressure.look() is DropReason.ANALYSIS_BEHIND  # not well enough yet
    await plant.bus.get()
    plant.bus.task_done()
    assert plant.pressure.look() is None


async def test_a_queue_that_fills_does_as_well(plant):
    for number in range(26):
        await plant.bus.put(counted_block(number))
    assert plant.pressure.look() is DropReason.ANALYSIS_BEHIND


def test_a_disk_that_is_nearly_full_takes_no_more_recordings(plant):
    plant.is_full = True
    assert plant.pressure.look() is DropReason.DISK_FULL
