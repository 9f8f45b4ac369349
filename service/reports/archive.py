"""Archive of evidence: reads the bundles of an alarm, as documents or for a ZIP file."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import islice
from pathlib import Path

from pydantic import ValidationError

from acquisition.recordings.manifest import MANIFEST
from core.alarms.alarm import ANNOUNCED, AlarmEvent
from service.recordings.around_alarms import is_captured
from service.reports.document import Evidence
from service.reports.folders import (
    DOCUMENT,
    CapturePart,
    EvidenceFolders,
    Place,
    kept_since_ns,
    linked,
    parsed,
    places,
    removed,
)
from service.runtime.times import compact
from service.settings.configuration import canonical
from service.store.port import AlarmQuery
from service.store.store import Store

PAGE = 1000
"""Number of events per query."""

Occurrences = frozenset[tuple[str, int]]
"""Set of occurrences, each as alarm id and number of the occurrence."""


class EvidenceState(StrEnum):
    """State of the evidence: written, still to be written, lost, removed, or never kept."""

    COMPLETE = "complete"
    WAITING = "waiting"
    LOST = "lost"
    REMOVED = "removed"
    NOT_KEPT = "not_kept"


class SamplesState(StrEnum):
    """State of the samples around an occurrence; `NONE` if none were to be recorded."""

    COMPLETE = "complete"
    BEING_MADE = "being_made"
    LOST = "lost"
    REMOVED = "removed"
    NONE = "none"


class DamagedEvidenceError(Exception):
    """Error raised if a bundle was changed or damaged; the message states bundle and fault."""


@dataclass(frozen=True)
class Occurrence:
    """Occurrence of an alarm with the state of its evidence.

    Parameters
    ----------
    event
        Event that raised or escalated the alarm.
    place
        Location of the bundle; None unless the bundle is complete.
    """

    event: AlarmEvent
    state: EvidenceState
    place: Place | None = None

    @property
    def bundle(self) -> Place:
        """Location of the bundle; raises `LookupError` unless the bundle is complete."""
        if self.place is None:
            raise LookupError(f"alarm {self.event.identity.id} has no complete evidence bundle")
        return self.place


class EvidenceArchive:
    """Archive of evidence bundles, read only. Its methods block: call them in a thread.

    `films` is the store of the readings of films.
    """

    def __init__(self, folders: EvidenceFolders, store: Store) -> None:
        self.folders, self._store, self.films = folders, store, store.films

    def occurrences(self, alarm: str, pending: Occurrences, most: int) -> list[Occurrence]:
        """Return the newest occurrences of an alarm, at most `most`, newest first.

        The list is empty if the store has no event that raised or escalated the alarm.

        Parameters
        ----------
        pending
            Occurrences whose bundles are still to be written, determined before this call.

        Raises
        ------
        StoreError
            If the store cannot be read.
        """
        events = (each for each in self.events(alarm) if each.change in ANNOUNCED)
        found = list(islice(events, most))
        return self._with_bundles(alarm, found, pending)

    def occurrence(self, alarm: str, number: int, pending: Occurrences) -> Occurrence | None:
        """Return an occurrence of an alarm; None if the alarm has no occurrence of this number.

        `pending` are the occurrences whose bundles are still to be written, determined before this
        call. Raises `StoreError` if the store cannot be read.
        """
        for event in self.events(alarm):
            if event.occurrence < number:
                break  # events are in the order of occurrences
            if event.occurrence == number and event.change in ANNOUNCED:
                return self._with_bundles(alarm, [event], pending)[0]
        return None

    def events(self, alarm: str) -> Iterator[AlarmEvent]:
        """Yield all events of an alarm, newest first; any step may raise `StoreError`."""
        before = AlarmQuery().before
        while page := self._store.alarm_events(AlarmQuery(before, PAGE, alarm=alarm)):
            yield from (stored.event for stored in page)
            before = page[-1].id

    def document(self, place: Place) -> Evidence:
        """Read the document of a bundle and verify its checksum.

        Raises
        ------
        DamagedEvidenceError
            If the document was changed or damaged.
        """
        try:
            text = (place.folder / DOCUMENT).read_bytes()
            found = Evidence.model_validate_json(text)
        except (OSError, ValidationError) as error:
            why = f"{place.folder.name}: {DOCUMENT} cannot be read: {error}; restore a backup"
            raise DamagedEvidenceError(why) from error
        content = json.loads(text)
        del content["sha256"]
        if hashlib.sha256(canonical(content)).hexdigest() != found.sha256:
            why = "was changed since it was written: its SHA-256 differs from the stored one"
            raise DamagedEvidenceError(f"{place.folder.name}: {DOCUMENT} {why}; restore a backup")
        return found

    def samples(self, found: Occurrence, capturing: Occurrences) -> SamplesState:
        """Return the state of the samples around an occurrence.

        Parameters
        ----------
        capturing
            Occurrences whose samples are still being recorded, determined before this call.

        Raises
        ------
        DamagedEvidenceError
            If the document must be read and was changed or damaged.
        """
        event, place = found.event, found.place
        if place is not None and (capture := linked(place.folder)) is not None:
            if capture.state == "lost":
                return SamplesState.LOST
            is_there = capture_folder(place, capture) is not None
            return SamplesState.COMPLETE if is_there else SamplesState.REMOVED
        if (event.identity.id, event.occurrence) in capturing:
            return SamplesState.BEING_MADE
        was_kept = found.state is not EvidenceState.NOT_KEPT and is_captured(event)
        if was_kept and place is not None:
            was_kept = self.document(place).samples_expected
        return SamplesState.LOST if was_kept else SamplesState.NONE

    def configuration(self, version: str) -> Path | None:
        """Return the file of a configuration by its version (hash); None if it does not exist."""
        path = self.folders.configurations / f"{version}.json"
        return path if path.is_file() else None

    def _with_bundles(
        self, alarm: str, events: list[AlarmEvent], pending: Occurrences
    ) -> list[Occurrence]:
        unit, root = alarm.partition(":")[0], self.folders.evidence
        kept: dict[int, list[Place]] = {}
        for place in places(root, unit):
            if place.alarm == alarm:
                kept.setdefault(place.occurrence, []).append(place)
        gone = {
            number
            for found in map(parsed, removed(root, unit))
            if found and f"{unit}:{found[0]}:{found[1]}" == alarm
            for number in found[2:]
        }
        since_ns = kept_since_ns(root)

        def state(event: AlarmEvent) -> Occurrence:
            if own := kept.get(event.occurrence):  # of several, the one of this event
                moment = compact(event.time_ns)
                place = max(own, key=lambda each: (each.moment == moment, each.moment))
                return Occurrence(event, EvidenceState.COMPLETE, place)
            if (alarm, event.occurrence) in pending:
                return Occurrence(event, EvidenceState.WAITING)
            if event.occurrence in gone:
                return Occurrence(event, EvidenceState.REMOVED)
            was_kept = since_ns is not None and event.time_ns >= since_ns
            return Occurrence(event, EvidenceState.LOST if was_kept else EvidenceState.NOT_KEPT)

        return [state(event) for event in events]


def capture_folder(place: Place, capture: CapturePart) -> Path | None:
    """Return the folder of the recording that a bundle links to; None if lost or removed."""
    if capture.folder is None or capture.manifest is None:
        return None
    folder = place.folder / capture.folder
    return folder if (folder / MANIFEST).is_file() else None


README = """Evidence of an alarm, made by padwatch.

report.html             one page to read or print
evidence.json           the document; docs/how-to/evidence.md of padwatch describes its keys
spectra.parquet         cross-spectra of all bearings of the unit
orbits.parquet          the newest turns of the shaft
trend.parquet           readings of the film before the alarm
configuration.json      settings of the plant, without secrets; not for a key of some units
capture.json            which recording holds the samples around the alarm
samples/                that recording: padwatch recording info|verify|export reads it
"""


def bundle_files(
    archive: EvidenceArchive, found: Occurrence, page: str, has_configuration: bool
) -> Mapping[str, Path | bytes]:
    """Return the files of a bundle by their names in a ZIP file: paths, or content as bytes.

    The recording of the samples is included under ``samples/`` if it still exists.

    Parameters
    ----------
    page
        Report of the occurrence, HTML.
    has_configuration
        Whether to include the configuration of the whole plant.

    Raises
    ------
    DamagedEvidenceError, LookupError
        If the bundle cannot be read, or does not exist.
    """
    place = found.bundle
    files: dict[str, Path | bytes] = {"README.txt": README.encode(), "report.html": page.encode()}
    files |= {path.name: path for path in sorted(place.folder.iterdir())}
    if has_configuration:
        configuration = archive.configuration(archive.document(place).configuration)
        if configuration is not None:
            files["configuration.json"] = configuration
    capture = linked(place.folder)
    samples = None if capture is None else capture_folder(place, capture)
    if samples is not None:
        files |= {f"samples/{path.name}": path for path in sorted(samples.iterdir())}
    return files
