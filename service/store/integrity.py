"""Integrity of a database: detection of an outdated copy and of damaged rows."""

from collections.abc import Callable, Sequence

from service.store.access.audit_entries import AuditAction
from service.store.audit import AuditChain
from service.store.highwater.commits import CommitMarks, MarkFinding
from service.store.seals import DamageLog, Place


class Integrity:
    """Integrity checks of a database; no findings for PostgreSQL, which checks its data itself.

    Parameters
    ----------
    marks
        High-water mark of a SQLite database; None for PostgreSQL.
    damage
        Log of the damaged and missing rows found since the start.
    check_some
        Function that checks the next rows; returns True when all rows have been checked once.
    require_file
        Function that raises `StoreError` if the database file was removed or replaced.
    """

    def __init__(
        self,
        chain: AuditChain,
        marks: CommitMarks | None = None,
        damage: DamageLog | None = None,
        check_some: Callable[[], bool] = lambda: True,
        require_file: Callable[[], None] = lambda: None,
    ) -> None:
        self._chain, self._marks, self._damage = chain, marks, damage or DamageLog()
        self.check_some, self.require_file = check_some, require_file

    @property
    def found(self) -> Sequence[MarkFinding]:
        """Differences from the high-water mark at opening; empty after `adopt`."""
        return () if self._marks is None else self._marks.found

    @property
    def mark_error(self) -> str | None:
        """Error of the last attempt to write the high-water mark; None if it succeeded."""
        return None if self._marks is None else self._marks.error

    @property
    def n_damaged(self) -> int:
        """Number of damaged and missing rows found since the start; queries omit damaged rows."""
        return self._damage.n_damaged

    @property
    def damaged(self) -> Sequence[Place]:
        """Damaged and missing rows found since the start, at most `seals.MAX_PLACES`."""
        return self._damage.places

    def adopt(self, now_ns: int) -> Sequence[MarkFinding]:
        """Accept the database as the newest copy; return the differences that were found.

        Differences are recorded in the audit trail with the time `now_ns`.

        Raises
        ------
        StoreError
            If the database cannot be written.
        """
        found = self.found
        if found and self._marks is not None:
            with self._chain.writing() as writer:
                self._marks.adopt(writer)
                self._chain.add(writer, [_action(finding, now_ns) for finding in found])
            self._marks.adopted()
        return found


def _action(finding: MarkFinding, now_ns: int) -> AuditAction:
    return AuditAction(
        time_ns=now_ns,
        actor="padwatch",
        action=f"store.{finding.kind}",
        object="store",
        after={"n_transactions_missing": finding.n_missing},
        reason=finding.detail,
    )
