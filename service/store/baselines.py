"""Baselines, and the steps that put versions in force."""

from collections.abc import Iterable
from dataclasses import dataclass

from core.baseline.baseline import BearingBaseline
from core.change.shaft_response import ShaftResponse
from core.machine.unit import Estimator
from service.store.database import Connection
from service.store.documents import baseline_from_json, response_from_json, to_json
from service.store.film_port import BaselineEntry, BaselineStep, StoredStep
from service.store.port import StoreError

ENTRY_COLUMNS = (
    "unit, bearing, estimator, version, created_ns, author,"
    " learned_from_ns, learned_until_ns, event"
)
INSERT_BASELINE = (
    f"INSERT INTO baseline ({ENTRY_COLUMNS}, document)"  # noqa: S608
    " VALUES (?,?,?,?,?,?,?,?,?,?)"
)
STEP_COLUMNS = "unit, bearing, version, step, time_ns, from_ns, actor, reason"
INSERT_STEP = f"INSERT INTO baseline_step ({STEP_COLUMNS}) VALUES (?,?,?,?,?,?,?,?)"  # noqa: S608
SET_RESPONSE = """
    INSERT INTO shaft_response VALUES (?, ?, ?)
    ON CONFLICT (unit) DO UPDATE SET
    created_ns = excluded.created_ns, document = excluded.document
"""


def insert_baseline(writer: Connection, baseline: BearingBaseline) -> None:
    """Add a baseline to those of its bearing."""
    origin = baseline.origin
    writer.execute(
        INSERT_BASELINE,
        (
            *(origin.unit, origin.bearing, origin.estimator, origin.version, origin.created_ns),
            *(origin.author, baseline.learned_from_ns, baseline.learned_until_ns, origin.event),
            to_json(baseline),
        ),
    )


def is_kept(reader: Connection, baseline: BearingBaseline) -> bool:
    """Whether just this baseline is written already."""
    origin = baseline.origin
    return select_document(reader, origin.unit, origin.bearing, origin.version) == to_json(baseline)


def are_kept(reader: Connection, steps: Iterable[StoredStep]) -> bool:
    """Whether all of this is written already: nobody does the same twice at the same moment."""
    return all(step in select_steps(reader, step.unit, step.bearing) for step in steps)


def insert_steps(writer: Connection, steps: Iterable[StoredStep]) -> None:
    """Add what was done to baselines."""
    writer.executemany(
        INSERT_STEP,
        [
            (s.unit, s.bearing, s.version, s.step.value, s.time_ns, s.from_ns, s.actor, s.reason)
            for s in steps
        ],
    )


def select_baselines(reader: Connection, unit: str, bearing: str) -> list[BaselineEntry]:
    """Every baseline of a bearing, newest first."""
    rows = reader.execute(
        f"SELECT {ENTRY_COLUMNS} FROM baseline"  # noqa: S608
        " WHERE unit = ? AND bearing = ? ORDER BY version DESC",
        (unit, bearing),
    )
    return [
        BaselineEntry(unit, bearing, Estimator(estimator), *rest)
        for unit, bearing, estimator, *rest in rows
    ]


def select_baseline(
    reader: Connection, unit: str, bearing: str, version: int
) -> BearingBaseline | None:
    """One baseline whole.

    Raises
    ------
    StoreError
        If what is stored is no baseline.
    """
    found = select_document(reader, unit, bearing, version)
    try:
        return None if found is None else baseline_from_json(found)
    except ValueError as error:
        name = f"baseline {version} of unit {unit} bearing {bearing}"
        raise StoreError(f"{name}: {error}") from error


def select_document(reader: Connection, unit: str, bearing: str, version: int) -> str | None:
    """One baseline as it is stored."""
    found = reader.execute(
        "SELECT document FROM baseline WHERE unit = ? AND bearing = ? AND version = ?",
        (unit, bearing, version),
    ).fetchone()
    return None if found is None else str(found[0])


def select_steps(reader: Connection, unit: str, bearing: str) -> list[StoredStep]:
    """What was done to the baselines of a bearing, oldest first."""
    rows = reader.execute(
        f"SELECT {STEP_COLUMNS} FROM baseline_step"  # noqa: S608
        " WHERE unit = ? AND bearing = ? ORDER BY id",
        (unit, bearing),
    )
    return [
        StoredStep(unit, bearing, version, BaselineStep(step), time_ns, actor, reason, from_ns)
        for unit, bearing, version, step, time_ns, from_ns, actor, reason in rows
    ]


def set_response(writer: Connection, unit: str, response: ShaftResponse, now_ns: int) -> None:
    """Put a unit's response in the place of the one before."""
    writer.execute(SET_RESPONSE, (unit, now_ns, to_json(response)))


def select_responses(reader: Connection) -> dict[str, ShaftResponse]:
    """How shafts answer, by unit.

    Raises
    ------
    StoreError
        If what is stored is no response.
    """
    rows = reader.execute("SELECT unit, document FROM shaft_response").fetchall()
    try:
        return {unit: response_from_json(document) for unit, document in rows}
    except ValueError as error:
        raise StoreError(f"the response of a shaft: {error}") from error


@dataclass(frozen=True)
class Versions:
    """Where the baselines of a bearing stand.

    Parameters
    ----------
    in_force
        What its readings are compared with; None if there is none.
    rejected
        What must not be put in force.
    is_frozen
        Whether nothing more is learned until an engineer says so.
    renewed_ns
        From when on readings count for learning; None for all.
    first_accepted
        The first that was put in force since then.
    """

    in_force: int | None = None
    rejected: frozenset[int] = frozenset()
    is_frozen: bool = False
    renewed_ns: int | None = None
    first_accepted: int | None = None


def versions_after(steps: Iterable[StoredStep]) -> Versions:
    """Where the baselines of a bearing stand after everything that was done, oldest first."""
    in_force: int | None = None
    first: int | None = None
    rejected: set[int] = set()
    is_frozen, renewed_ns = False, None
    for done in steps:
        match done.step:
            case BaselineStep.ACCEPTED:
                in_force = done.version
                first = done.version if first is None else first
                rejected.discard(done.version or 0)
            case BaselineStep.REJECTED | BaselineStep.WITHDRAWN:
                rejected.add(done.version or 0)
                in_force = None if in_force == done.version else in_force
            case BaselineStep.FROZEN | BaselineStep.THAWED:
                is_frozen = done.step is BaselineStep.FROZEN
            case BaselineStep.RENEWED:
                in_force = first = None
                is_frozen, renewed_ns = False, done.from_ns
            case BaselineStep.LEARNED:
                pass
    return Versions(in_force, frozenset(rejected), is_frozen, renewed_ns, first)
