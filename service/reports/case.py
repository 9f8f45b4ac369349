"""Data of a report: the bundle of an occurrence, and events and readings after it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

from core.alarms.alarm import AlarmEvent
from core.machine.unit import Estimator
from core.units import DAY_NS
from service.reports.archive import EvidenceArchive, Occurrence, SamplesState
from service.reports.document import Evidence
from service.reports.parts import AXES, BearingPart, ComparisonPart, Direction
from service.reports.tables import ORBITS, SPECTRA, TREND, Columns, read_table, trend_columns
from service.store.film_readings import FilmQuery


@dataclass(frozen=True)
class Case:
    """Data of a report: the bundle of an occurrence of an alarm, and later data.

    Parameters
    ----------
    evidence
        Document of the bundle.
    spectra, orbits, before
        Tables of spectra, orbits and readings of the film in the bundle; empty if missing.
    after
        Readings of the film after the alarm, from the store, with the columns of `before`; empty
        without readings.
    events
        Events of the occurrence, oldest first.
    samples
        State of the samples around the alarm.
    """

    evidence: Evidence
    spectra: Columns
    orbits: Columns
    before: Columns
    after: Columns
    events: Sequence[AlarmEvent]
    samples: SamplesState

    @property
    def bearing(self) -> BearingPart | None:
        """Bearing of the alarm; None if the alarm concerns no bearing."""
        found = (b for b in self.evidence.bearings if b.bearing == self.evidence.bearing)
        return next(found, None)

    @property
    def direction(self) -> Direction:
        """Direction of the alarm; x if the alarm has no direction."""
        return self.evidence.direction or AXES[0]

    @property
    def comparison(self) -> ComparisonPart | None:
        """Comparison of the film in `direction` with its baseline; None if there is none."""
        found = (c for c in self.evidence.comparisons if c.direction == self.direction)
        return next(found, None)


def read_case(
    archive: EvidenceArchive, found: Occurrence, samples: SamplesState, trend_days: float
) -> Case:
    """Read the data of a report, with readings of the film up to `trend_days` after the alarm.

    Reads files and the store, and blocks meanwhile.

    Raises
    ------
    DamagedEvidenceError, TableError
        If the bundle cannot be read.
    LookupError
        If the bundle does not exist.
    StoreError
        If the store cannot be read.
    """
    folder, evidence = found.bundle.folder, archive.document(found.bundle)
    tables = {
        name: read_table(folder / name) if name in evidence.files else {}
        for name in (SPECTRA, ORBITS, TREND)
    }
    later = archive.events(found.event.identity.id)  # newest first
    own = takewhile(lambda event: event.occurrence >= found.event.occurrence, later)
    events = [event for event in own if event.occurrence == found.event.occurrence]
    return Case(
        evidence=evidence,
        spectra=tables[SPECTRA],
        orbits=tables[ORBITS],
        before=tables[TREND],
        after=_after(archive, evidence, trend_days) if tables[TREND] else {},
        events=events[::-1],
        samples=samples,
    )


def _after(archive: EvidenceArchive, evidence: Evidence, trend_days: float) -> Columns:
    bearing, since_ns = evidence.bearing, evidence.alarm.time_ns
    name = evidence.limits.get("estimators", {}).get(bearing)
    if bearing is None or name is None:
        return {}
    until_ns = since_ns + round(trend_days * DAY_NS)
    query = FilmQuery(evidence.alarm.unit, bearing, Estimator(name), since_ns + 1, until_ns)
    return trend_columns(archive.films.history(query))
