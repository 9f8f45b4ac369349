"""Writer of evidence bundles; it runs in the thread of the collector."""

import shutil
from contextlib import suppress
from pathlib import Path

from core.units import DAY_NS
from service.reports.contents import cell_of, comparison, members_of
from service.reports.document import Maker, composed, file_part, not_known, sealed
from service.reports.folders import DOCUMENT, INCOMPLETE, Place, place_of
from service.reports.parts import AXES, ComparisonPart
from service.reports.snapshot import Snapshot
from service.reports.tables import ORBITS, SPECTRA, TREND, orbits_table, spectra_table, trend_table
from service.runtime.files import sync_folder, write_synced
from service.settings.storage import EvidenceSettings
from service.store.film_readings import FilmQuery
from service.store.films import FilmStore


class EvidenceWriter:
    """Writer of evidence bundles; a bundle exists under its name only if it is complete."""

    def __init__(
        self, root: Path, maker: Maker, store: FilmStore, limits: EvidenceSettings
    ) -> None:
        self._root, self._maker, self._store, self._limits = root, maker, store, limits

    def write(self, snapshot: Snapshot, *, with_history: bool = True) -> Place:
        """Write the bundle of a snapshot and return its location; keep an existing bundle.

        `with_history` is whether to include readings from the store; if not, the document lists
        them as missing.

        Raises
        ------
        OSError
            If the disk cannot be written to; no partial files remain.
        StoreError
            If the store cannot be read.
        """
        place = place_of(self._root, snapshot.event)
        if place.folder.exists():
            return place
        aside = place.folder.with_name(place.folder.name + INCOMPLETE)
        try:
            aside.mkdir(parents=True, exist_ok=True)
            self._fill(aside, snapshot, with_history)
            sync_folder(aside)
            aside.rename(place.folder)
            sync_folder(place.folder.parent)
        except BaseException:
            with suppress(OSError):
                shutil.rmtree(aside)
            raise
        return place

    def _fill(self, folder: Path, snapshot: Snapshot, with_history: bool) -> None:
        missing = ["the store could not be read: no readings of cell and trend"]
        compared = self._compared(snapshot, with_history)
        for name, content in self._tables(snapshot, with_history).items():
            write_synced(folder / name, content)
        document = composed(snapshot, self._maker) | {
            "comparisons": compared,
            "missing": [*([] if with_history else missing), *not_known(snapshot)],
            "files": {path.name: file_part(path) for path in sorted(folder.iterdir())},
        }
        write_synced(folder / DOCUMENT, sealed(document))

    def _compared(self, snapshot: Snapshot, with_history: bool) -> list[ComparisonPart]:
        found = snapshot.bearings.get(snapshot.bearing or "")
        if found is None or found.film is None or snapshot.rules is None:
            return []
        cell, members = cell_of(found.film, snapshot.rules), None
        if with_history and cell is not None and found.baseline is not None:
            members = members_of(self._store, cell, found.baseline, snapshot.rules)
        rest = (found.baseline, snapshot.rules, members)
        return [comparison(found.film, axis, *rest) for axis in AXES]

    def _tables(self, snapshot: Snapshot, with_history: bool) -> dict[str, bytes]:
        found = [b.assessment for b in snapshot.bearings.values() if b.assessment is not None]
        tables = {SPECTRA: spectra_table(found), ORBITS: orbits_table(found)} if found else {}
        query = self._trend_query(snapshot)
        if with_history and query is not None:
            tables[TREND] = trend_table(self._store.history(query))
        return {name: table for name, table in tables.items() if table is not None}

    def _trend_query(self, snapshot: Snapshot) -> FilmQuery | None:
        bearing, rules = snapshot.bearing, snapshot.rules
        if bearing is None or rules is None or bearing not in rules.estimators:
            return None
        end_ns, unit = snapshot.event.time_ns, snapshot.event.identity.unit
        start_ns = end_ns - round(self._limits.trend_days * DAY_NS)
        return FilmQuery(unit, bearing, rules.estimators[bearing], start_ns, end_ns + 1)
