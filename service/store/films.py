"""Films behind the store's interface."""

from collections.abc import Iterable, Mapping, Sequence

from core.arrays import FloatArray
from core.baseline.baseline import BearingBaseline
from core.change.film_judge import FilmNews
from core.change.shaft_response import ShaftResponse
from core.machine.unit import Estimator
from service.store.audit_chain import AuditChain
from service.store.audit_deeds import step_deeds
from service.store.baselines import (
    are_kept,
    insert_baseline,
    insert_steps,
    is_kept,
    select_baseline,
    select_baselines,
    select_responses,
    select_steps,
    set_response,
)
from service.store.codec import Layout, remember_layout
from service.store.database import Connect, Connection
from service.store.film_port import (
    BaselineEntry,
    FilmHistory,
    FilmQuery,
    Provenance,
    StoredDecision,
    StoredStep,
)
from service.store.film_readings import insert_film_news, select_decisions, select_film_history
from service.store.series import series_of
from service.store.simulated_past import insert_past, select_past_end


class SqlFilms:
    """The film tables of one database.

    Parameters
    ----------
    writing
        Opens a transaction that is durable when left.
    reading
        Opens a connection that only reads.
    audit
        Takes what is done to baselines.
    """

    def __init__(
        self,
        writing: Connect,
        reading: Connect,
        audit: AuditChain,
    ) -> None:
        self._writing, self._reading, self._audit = writing, reading, audit

    def add_simulated(self, readings: Iterable[FilmNews]) -> None:
        """Write readings of a simulation, marked as such."""
        with self._writing() as writer:
            insert_film_news(writer, readings, Provenance.SIMULATED)

    def add_past(
        self,
        unit: str,
        bearing: str,
        estimator: Estimator,
        films: FilmHistory,
        values: Mapping[str, FloatArray],
    ) -> None:
        """Write a bearing's simulated past: readings of its film, and results for its trends."""
        with self._writing() as writer:
            layout = remember_layout(writer, Layout.of(tuple(values)))
            series = series_of(writer, unit, bearing)
            insert_past(writer, series, layout, estimator, films, values)

    def past_end_ns(self, unit: str, bearing: str) -> int | None:
        """Until when a bearing's past is simulated; None if none of it is."""
        with self._reading() as reader:
            return select_past_end(reader, unit, bearing)

    def history(self, query: FilmQuery) -> FilmHistory:
        """Read readings of one film, oldest first."""
        with self._reading() as reader:
            return select_film_history(reader, query)

    def first_ns(self, unit: str, bearing: str, estimator: Estimator) -> int | None:
        """Time of the first reading of a film."""
        with self._reading() as reader:
            found = reader.execute(
                "SELECT min(time_ns) FROM film_reading WHERE estimator = ? AND series ="
                " (SELECT id FROM series WHERE unit = ? AND bearing = ?)",
                (estimator.value, unit, bearing),
            ).fetchone()
        return None if found[0] is None else int(found[0])

    def decisions(self, unit: str, bearing: str) -> list[StoredDecision]:
        """Where the decisions of a bearing stood last."""
        with self._reading() as reader:
            return select_decisions(reader, unit, bearing)

    def add_baseline(self, baseline: BearingBaseline, steps: Sequence[StoredStep]) -> None:
        """Write a learned baseline with what is done with it at once; called again, it is nothing.

        That is for a call whose end nobody could tell.
        """
        with self._writing() as writer:
            if is_kept(writer, baseline) and are_kept(writer, steps):
                return
            insert_baseline(writer, baseline)
            self._add_steps(writer, steps)

    def baselines(self, unit: str, bearing: str) -> list[BaselineEntry]:
        """Every baseline that was ever learned of a bearing, newest first."""
        with self._reading() as reader:
            return select_baselines(reader, unit, bearing)

    def baseline(self, unit: str, bearing: str, version: int) -> BearingBaseline | None:
        """Read one baseline whole."""
        with self._reading() as reader:
            return select_baseline(reader, unit, bearing, version)

    def add_steps(self, steps: Sequence[StoredStep]) -> None:
        """Write what was done to baselines; called again, it is nothing."""
        with self._writing() as writer:
            if are_kept(writer, steps):
                return
            self._add_steps(writer, steps)

    def _add_steps(self, writer: Connection, steps: Sequence[StoredStep]) -> None:
        self._audit.add(writer, step_deeds(writer, steps))
        insert_steps(writer, steps)

    def steps(self, unit: str, bearing: str) -> list[StoredStep]:
        """What was done to the baselines of a bearing, oldest first."""
        with self._reading() as reader:
            return select_steps(reader, unit, bearing)

    def set_response(self, unit: str, response: ShaftResponse, now_ns: int) -> None:
        """Write how a unit's shaft answers to its films."""
        with self._writing() as writer:
            set_response(writer, unit, response, now_ns)

    def responses(self) -> dict[str, ShaftResponse]:
        """How shafts answer, by unit."""
        with self._reading() as reader:
            return select_responses(reader)
