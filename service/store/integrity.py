"""A store in a file, and how it knows that it is the newest."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager

from service.store.access.audit_entries import AuditAction
from service.store.audit_chain import AuditChain
from service.store.database import Connection
from service.store.highwater.commits import CommitMarks
from service.store.highwater.comparison import MarkFinding
from service.store.seals import DamageLog, Place


class Marked:
    """A store with a high-water mark beside it.

    Parameters
    ----------
    marks
        Of its database.
    writing
        Opens a transaction.
    chain
        Is told.
    damage
        Of its rows.
    check_some
        Looks at some more of them; whether that was once around.
    require_file
        Raises `StoreError` if the database's file was removed or replaced since it was opened.
    """

    def __init__(
        self,
        marks: CommitMarks,
        writing: Callable[[], AbstractContextManager[Connection]],
        chain: AuditChain,
        damage: DamageLog,
        check_some: Callable[[], bool],
        require_file: Callable[[], None],
    ) -> None:
        self.require_file = require_file
        self._marks, self._writing, self._chain = marks, writing, chain
        self._damage, self.check_some = damage, check_some

    @property
    def found(self) -> Sequence[MarkFinding]:
        """What was wrong with the database when it was opened, until it is adopted."""
        return self._marks.found

    @property
    def mark_error(self) -> str | None:
        """Why the high-water mark could not be written last; None if it could."""
        return self._marks.error

    @property
    def n_damaged(self) -> int:
        """Rows that were found damaged since the start, and are left out of what is read."""
        return self._damage.n_damaged

    @property
    def damaged(self) -> Sequence[Place]:
        """Where they are, as far as places are remembered."""
        return self._damage.places

    def adopt(self, now_ns: int) -> Sequence[MarkFinding]:
        """Go on with the database as it is, and tell the audit trail; what was wrong with it.

        Raises
        ------
        StoreError
            If the database cannot be written; then it will be found again.
        """
        found = self._marks.found
        if found:
            with self._writing() as writer:
                self._marks.adopt(writer)
                self._chain.add(writer, [_deed(finding, now_ns) for finding in found])
            self._marks.adopted()
        return found


def _deed(finding: MarkFinding, now_ns: int) -> AuditAction:
    return AuditAction(
        time_ns=now_ns,
        actor="padwatch",
        action=f"store.{finding.kind}",
        object="store",
        after={"n_transactions_missing": finding.n_missing},
        reason=finding.detail,
    )
