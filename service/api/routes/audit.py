"""The audit trail."""

import json
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Response
from pydantic import Field

from service.api.answers import rendered, worked
from service.api.auth.declared import needs
from service.api.context import Context
from service.api.parameters import EndTime, FirstTime, ns_from_datetime, require_order
from service.api.problems import described_problems
from service.api.tables import Column, Format, table_content, table_response
from service.api.values import ApiModel, Time
from service.runtime.times import rfc3339
from service.store.access.audit_entries import MAX_NAME, AuditEntry
from service.store.access.identities import Permission
from service.store.audit import AuditQuery

SourceName = Literal["api", "command_line", "padwatch"]


class AuditEntryModel(ApiModel):
    """One entry of the audit trail."""

    number: Annotated[int, Field(examples=[117])]
    """Number, from 1 without gaps."""

    time: Time
    """Time."""

    actor: Annotated[str, Field(examples=["A. Name"])]
    """Person or key; empty if unknown."""

    source: SourceName
    """Interface that was used."""

    peer: Annotated[str | None, Field(examples=["127.0.0.1"])]
    """Address of the client, or user of the operating system; null if there is none."""

    action: Annotated[str, Field(examples=["alarm.shelved"])]
    """Action."""

    object: Annotated[str, Field(examples=["U1:ujb_shaft_x:channel_not_ok"])]
    """Object of the action."""

    before: Annotated[dict[str, Any] | None, Field(examples=[{"state": "unacknowledged"}])]
    """State of the object before; null if there is none."""

    after: Annotated[dict[str, Any] | None, Field(examples=[{"state": "shelved"}])]
    """State of the object after."""

    reason: str
    """Reason given by the actor."""

    previous_hash: str
    """Hash of the previous entry, 64 hexadecimal digits."""

    hash: str
    """SHA-256 of the other fields of this entry."""


class AuditModel(ApiModel):
    """A page of the audit trail."""

    entries: list[AuditEntryModel]
    """Newest first."""

    next_before: int | None
    """Value of ``before`` for the next page; null on the last page."""

    head_error: str | None
    """Why the file with the newest hash could not be written; null if it was. Entries are stored
    all the same."""


TEXTS = (
    *("actor", "source", "peer", "action", "object", "before", "after", "reason"),
    *("previous_hash", "hash"),
)


def audit_table(entries: Sequence[AuditEntry]) -> list[Column]:
    """Return entries as columns; states before and after are JSON."""
    return [
        Column("number", "count", [entry.number for entry in entries]),
        Column("time_utc", "time", [entry.time_ns for entry in entries]),
        *(Column(name, "text", [getattr(entry, name) for entry in entries]) for name in TEXTS),
    ]


MAX_ENTRIES = 1000

PROBLEMS = described_problems({422: "A wrong parameter", 503: "The store cannot be read"})


def audit_router(context: Context) -> APIRouter:
    """Return the route of the audit trail."""
    router = APIRouter(
        prefix="/api/v1/audit", tags=["audit"], dependencies=[needs(Permission.READ_AUDIT)]
    )

    @router.get(
        "",
        summary="Audit trail",
        response_model=AuditModel,
        responses={**PROBLEMS, **table_content("Audit trail")},
    )
    async def audit(query: Annotated[AuditQuery, Depends(audit_query)], wanted: Format) -> Response:
        """List entries with actor, action, object and state, newest first, in pages.

        As CSV or Parquet: one row per entry, states before and after as JSON.
        """
        one_more = AuditQuery(**{**vars(query), "limit": query.limit + 1})
        found = await worked(lambda: context.store.audit.entries(one_more))
        page = list(found[: query.limit])
        next_before = page[-1].number if len(found) > query.limit else None
        if wanted == "json":
            head_error = context.store.audit.head_error
            return await rendered(lambda: _answer(page, next_before, head_error))
        cursor = None if next_before is None else str(next_before)
        return table_response(wanted, audit_table(page), "audit", cursor)

    return router


def _answer(
    page: Sequence[AuditEntry], next_before: int | None, head_error: str | None
) -> AuditModel:
    entries = [_model(entry) for entry in page]
    return AuditModel(entries=entries, next_before=next_before, head_error=head_error)


async def audit_query(
    actor: Annotated[
        str | None, Query(max_length=MAX_NAME, description="Only this actor.", examples=["A. Name"])
    ] = None,
    action: Annotated[
        str | None,
        Query(max_length=MAX_NAME, description="Only this action.", examples=["alarm.shelved"]),
    ] = None,
    object: Annotated[  # noqa: A002
        str | None,
        Query(
            max_length=MAX_NAME,
            description="Only this object.",
            examples=["U1:ujb_shaft_x:channel_not_ok"],
        ),
    ] = None,
    start: FirstTime = None,
    end: EndTime = None,
    before: Annotated[
        int | None,
        Query(ge=1, le=10**15, description="Only entries older than this number.", examples=[117]),
    ] = None,
    limit: Annotated[
        int, Query(ge=1, le=MAX_ENTRIES, description="Most entries in the answer.")
    ] = 100,
) -> AuditQuery:
    """Check which entries are wanted."""
    everything = AuditQuery()
    start_ns = ns_from_datetime(start, "start") if start else everything.start_ns
    end_ns = ns_from_datetime(end, "end") if end else everything.end_ns
    require_order(start_ns, end_ns)
    return AuditQuery(
        before=everything.before if before is None else before,
        limit=limit,
        actor=actor,
        action=action,
        object=object,
        start_ns=max(start_ns, everything.start_ns),
        end_ns=min(end_ns, everything.end_ns),
    )


def _model(entry: AuditEntry) -> AuditEntryModel:
    shown: dict[str, Any] = vars(entry) | {
        "before": _document(entry.before),
        "after": _document(entry.after),
        "time": rfc3339(entry.time_ns),
    }
    del shown["time_ns"]
    return AuditEntryModel.model_validate(shown)


def _document(text: str | None) -> dict[str, Any] | None:
    """A stored document; what is none, as the text that it is."""
    if text is None:
        return None
    try:
        document = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError):
        document = text
    return document if isinstance(document, dict) else {"text": text}


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no number")
