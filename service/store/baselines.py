"""Tables of baselines, steps in their life cycles, and shaft responses."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from enum import StrEnum
from typing import Annotated

from pydantic import Field

from core.baseline.baseline import BearingBaseline
from core.change.shaft_response import ShaftResponse
from core.machine.unit import Estimator
from service.runtime.models import SERVED, NotServed, TimeNs
from service.store.access.audit_entries import AuditAction, acting
from service.store.audit import AuditedTables
from service.store.database import Connection, insert, upsert
from service.store.documents import from_json, to_json
from service.store.port import StoreError

PADWATCH = "padwatch"


class BaselineStep(StrEnum):
    """Step in the life cycle of the baselines of a bearing.

    The newest `ACCEPTED` or `WITHDRAWN` determines the version in force. The newest `FROZEN` or
    `THAWED` determines whether learning is suspended. `RENEWED` starts learning from a new time.
    """

    LEARNED = "learned"
    ACCEPTED = "accepted"
    REJECTED = "rejected"
    WITHDRAWN = "withdrawn"
    FROZEN = "frozen"
    THAWED = "thawed"
    RENEWED = "renewed"


@dataclass(frozen=True)
class StoredStep:
    """Stored step in the life cycle of the baselines of a bearing."""

    __pydantic_config__ = SERVED

    unit: Annotated[str, NotServed]
    bearing: Annotated[str, NotServed]

    version: int | None
    """Version of the baseline; null for "renewed"."""

    step: BaselineStep
    """Kind of step."""

    time_ns: TimeNs
    """Time of the step."""

    actor: str
    """Person, API key or program that acted; empty if unknown."""

    reason: str
    """Reason given by the person or program that acted; may be empty."""

    from_ns: Annotated[
        TimeNs | None,
        Field(
            serialization_alias="event_time",
            description='For "renewed", time of the machine event; earlier readings are not used.',
        ),
    ] = None


@dataclass(frozen=True)
class BaselineEntry:
    """Metadata of a stored baseline.

    Readings from `learned_from_ns` on, before `learned_until_ns`, were used for learning; times are
    ns since 1970 UTC. `event` is the machine event that required the baseline, or empty.
    """

    unit: str
    bearing: str
    estimator: Estimator
    version: int
    created_ns: int
    author: str
    learned_from_ns: int
    learned_until_ns: int
    event: str


@dataclass(frozen=True)
class Versions:
    """State of the baselines of a bearing.

    Parameters
    ----------
    in_force
        Version with which readings are compared; None if no version is in force.
    rejected
        Versions that must not be put in force.
    is_frozen
        Whether learning is suspended until an engineer resumes it.
    renewed_ns
        Time from which readings are used for learning; None for all readings.
    first_accepted
        First version put in force since the last renewal; None if there was no such version.
    """

    in_force: int | None = None
    rejected: frozenset[int] = frozenset()
    is_frozen: bool = False
    renewed_ns: int | None = None
    first_accepted: int | None = None


def versions_after(steps: Iterable[StoredStep]) -> Versions:
    """Return the state of a bearing's baselines after the given steps, oldest step first."""
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


ENTRY_COLUMNS = [field.name for field in fields(BaselineEntry)]
STEP_COLUMNS = [field.name for field in fields(StoredStep)]
OF_BEARING = "WHERE unit = ? AND bearing = ?"
INSERT_BASELINE = insert("baseline", [*ENTRY_COLUMNS, "document"])
INSERT_STEP = insert("baseline_step", STEP_COLUMNS)
SELECT_STEPS = f"SELECT {', '.join(STEP_COLUMNS)} FROM baseline_step {OF_BEARING} ORDER BY id"  # noqa: S608
SELECT_BASELINES = (
    f"SELECT {', '.join(ENTRY_COLUMNS)} FROM baseline {OF_BEARING} ORDER BY version DESC"  # noqa: S608
)
SELECT_DOCUMENT = f"SELECT document FROM baseline {OF_BEARING} AND version = ?"  # noqa: S608
SET_RESPONSE = upsert("shaft_response", ("unit", "created_ns", "document"), ("unit",))


class BaselineTables(AuditedTables):
    """Store of baselines, their steps and shaft responses; changes are on the disk on return."""

    def add_baseline(self, baseline: BearingBaseline, steps: Sequence[StoredStep]) -> None:
        """Write a learned baseline with its first steps; writing it again has no effect."""
        origin, document = baseline.origin, to_json(baseline)
        key = (origin.unit, origin.bearing, origin.version)
        learned = (baseline.learned_from_ns, baseline.learned_until_ns)
        created = (origin.estimator, origin.version, origin.created_ns, origin.author)
        row = (origin.unit, origin.bearing, *created, *learned, origin.event, document)
        with self._writing() as writer:
            is_stored = writer.execute(SELECT_DOCUMENT, key).fetchone() == (document,)
            if not (is_stored and _are_stored(writer, steps)):
                writer.execute(INSERT_BASELINE, row)
                self._add_steps(writer, steps)

    def baselines(self, unit: str, bearing: str) -> list[BaselineEntry]:
        """Return the metadata of all baselines of a bearing, newest first."""
        with self._reading() as reader:
            return [
                BaselineEntry(unit, bearing, Estimator(estimator), *rest)
                for _, _, estimator, *rest in reader.execute(SELECT_BASELINES, (unit, bearing))
            ]

    def baseline(self, unit: str, bearing: str, version: int) -> BearingBaseline | None:
        """Return a baseline; None if the version is unknown.

        Raises `StoreError` if the document of the baseline is invalid.
        """
        with self._reading() as reader:
            found = reader.execute(SELECT_DOCUMENT, (unit, bearing, version)).fetchone()
        try:
            return None if found is None else from_json(BearingBaseline, found[0])
        except ValueError as error:
            name = f"baseline {version} of unit {unit} bearing {bearing}"
            raise StoreError(f"{name} is invalid ({error}); restore a backup") from error

    def add_steps(self, steps: Sequence[StoredStep]) -> None:
        """Write baseline steps; writing the same steps again has no effect."""
        with self._writing() as writer:
            if not _are_stored(writer, steps):
                self._add_steps(writer, steps)

    def steps(self, unit: str, bearing: str) -> list[StoredStep]:
        """Return the baseline steps of a bearing, oldest first."""
        with self._reading() as reader:
            return _select_steps(reader, unit, bearing)

    def set_response(self, unit: str, response: ShaftResponse, now_ns: int) -> None:
        """Write the shaft response of a unit at `now_ns`; it replaces the previous response."""
        with self._writing() as writer:
            writer.execute(SET_RESPONSE, (unit, now_ns, to_json(response)))

    def responses(self) -> dict[str, ShaftResponse]:
        """Return the shaft responses by unit id; raise `StoreError` if one is invalid."""
        with self._reading() as reader:
            rows = reader.execute("SELECT unit, document FROM shaft_response").fetchall()
        try:
            return {unit: from_json(ShaftResponse, document) for unit, document in rows}
        except ValueError as error:
            raise StoreError(f"a shaft response is invalid ({error}); restore a backup") from error

    def _add_steps(self, writer: Connection, steps: Sequence[StoredStep]) -> None:
        self._audit.add(writer, _actions(writer, steps))
        rows = [tuple(getattr(step, name) for name in STEP_COLUMNS) for step in steps]
        writer.executemany(INSERT_STEP, rows)


def _are_stored(reader: Connection, steps: Iterable[StoredStep]) -> bool:
    return all(step in _select_steps(reader, step.unit, step.bearing) for step in steps)


def _select_steps(reader: Connection, unit: str, bearing: str) -> list[StoredStep]:
    rows = reader.execute(SELECT_STEPS, (unit, bearing))
    return [
        StoredStep(unit, bearing, version, BaselineStep(step), *rest)
        for _, _, version, step, *rest in rows
    ]


def _actions(writer: Connection, steps: Sequence[StoredStep]) -> list[AuditAction]:
    """Return the audit entries about steps that will be written; none for automatic learning."""
    actions = []
    for place in dict.fromkeys((step.unit, step.bearing) for step in steps):
        done = _select_steps(writer, *place)
        for step in steps:
            if (step.unit, step.bearing) == place:
                before = versions_after(done)
                done.append(step)
                if step.step is not BaselineStep.LEARNED or step.actor != PADWATCH:
                    actions.append(_action(step, before, versions_after(done)))
    return actions


def _action(step: StoredStep, before: Versions, after: Versions) -> AuditAction:
    parts = (step.unit, step.bearing, step.version)
    return AuditAction(
        time_ns=step.time_ns,
        actor=step.actor,
        action=f"baseline.{step.step.value}",
        object=":".join(str(part) for part in parts if part is not None),
        before=_document(before),
        after=_document(after),
        reason=step.reason,
        source=acting().source,
        peer=acting().peer,
    )


def _document(versions: Versions) -> dict[str, object]:
    return asdict(versions) | {"rejected": sorted(versions.rejected)}
