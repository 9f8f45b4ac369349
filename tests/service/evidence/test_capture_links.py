"""A bundle leads to the samples around its alarm, or says what has become of them."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquisition.recording.manifest import MANIFEST
from core.alarms.event import AlarmEvent
from service.capture.file import _write_alarms
from service.capture.folders import ALARM
from service.capture.outcome import Outcome
from service.evidence.snapshot import Camera

Make = Callable[..., Any]
NOBODY: frozenset[tuple[str, int]] = frozenset()
SHAFT = "U1:UJB:order1_shaft_x"
CAPTURE = "U1-20260101T000000.000Z-x"


def recorded(folder: Path, event: AlarmEvent) -> Path:
    """What a finished capture leaves, as far as links go."""
    folder.mkdir(parents=True)
    (folder / MANIFEST).write_text("{}")
    _write_alarms(folder / ALARM, [event])
    return folder


def samples(rig: Any, capturing: frozenset[tuple[str, int]] = NOBODY) -> str:
    [found] = rig.archive.occurrences(SHAFT, NOBODY, 9)
    return str(rig.archive.samples(found, capturing).value)


async def test_a_finished_capture_is_linked_with_its_hash(rig: Any, news: Make) -> None:
    raised = news()
    capture = recorded(rig.folders.captures / CAPTURE, raised.events[0])
    async with rig.running():
        rig.raise_(raised)
        rig.keeper.captured(Outcome(raised.events, capture))
        found = await rig.linked()

    assert (rig.bundles[0] / found.folder).resolve() == capture.resolve()
    assert found.manifest.size == 2
    assert samples(rig) == "complete"
    shutil.rmtree(capture)
    assert samples(rig) == "removed"


async def test_samples_that_could_not_be_kept_are_said_to_be_lost(rig: Any, news: Make) -> None:
    raised = news()
    async with rig.running():
        rig.raise_(raised)
        rig.keeper.captured(Outcome(raised.events, None, "the disk is too slow for them"))
        found = await rig.linked()

    assert (found.state, found.reason) == ("lost", "the disk is too slow for them")
    assert samples(rig) == "lost"


async def test_a_capture_that_was_finished_just_before_a_crash_is_linked_after_it(
    rig_of: Make, rig: Any, news: Make
) -> None:
    raised = news()
    await rig.write(raised)
    assert samples(rig) == "none"  # this service has not kept any
    recorded(rig.folders.captures / CAPTURE, raised.events[0])

    again = await rig_of()
    async with again.running():
        await again.linked()
    assert samples(again) == "complete"


async def test_samples_that_were_expected_and_never_came_are_lost(rig: Any, news: Make) -> None:
    rig.keeper._camera = Expecting({u.id: u for u in rig.plant.unit}, rig.live, rig.films)
    await rig.write(news())

    assert samples(rig, frozenset({(SHAFT, 1)})) == "being_made"
    assert samples(rig) == "lost"


class Expecting(Camera):
    """A service that keeps the samples around alarms."""

    def take(self, event: AlarmEvent, now_ns: int, samples_expected: bool) -> Any:
        return replace(super().take(event, now_ns, samples_expected), samples_expected=True)
