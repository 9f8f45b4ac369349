"""Route for the audit trail: recorded actions of persons, machines and the service."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

from fastapi import Depends, Response
from pydantic import BeforeValidator, Field
from pydantic_core import from_json

from service.api.answers import rendered
from service.api.auth.gate import GuardedRouter, subject_router
from service.api.context import Context
from service.api.parameters import OptionalTimeRange, at_most, only, parameter
from service.api.tables import Column, Format, table_content, table_response
from service.api.values import ApiModel, Time
from service.store.access.audit_entries import MAX_NAME, AuditEntry, Source
from service.store.access.identities import Permission
from service.store.audit import AuditQuery, AuditStore, by_time


def _document(text: object) -> object:
    """Return the object in a stored JSON text; other text as ``{"text": text}``."""
    if not isinstance(text, str):
        return text
    try:
        document = from_json(text, allow_inf_nan=False)
    except ValueError:
        document = text
    return document if isinstance(document, dict) else {"text": text}


Document = Annotated[dict[str, Any] | None, BeforeValidator(_document)]


class AuditEntryModel(ApiModel):
    """Entry of the audit trail: one action with its actor and object."""

    actor: Annotated[str, Field(examples=["A. Name"])]
    reason: str
    number: Annotated[int, Field(examples=[117])]
    time: Time

    chain: Annotated[str, Field(examples=["access"])]
    """Chain of the entry. With SQLite, `access` has logins, accounts, keys and refused requests,
    and `padwatch` has everything else; with PostgreSQL, the only chain is `postgresql`."""

    source: Source
    """Source of the action: API, command line, or padwatch itself."""

    peer: Annotated[str | None, Field(examples=["127.0.0.1"])]
    """Network address of the client, or user name in the operating system; null if unknown."""

    action: Annotated[str, Field(examples=["alarm.shelved"])]
    """Name of the action."""

    object: Annotated[str, Field(examples=["U1:ujb_shaft_x:channel_not_ok"])]
    """Object of the action, such as the identifier of an alarm."""

    before: Annotated[Document, Field(examples=[{"state": "unacknowledged"}])]
    """State of the object before the action; null without a state."""

    after: Annotated[Document, Field(examples=[{"state": "shelved"}])]
    """State of the object after the action; null without a state."""

    previous_hash: str
    """Hash of the previous entry of the chain, 64 hexadecimal digits."""

    hash: str
    """SHA-256 hash of the other fields of this entry, including the previous hash."""


class AuditModel(ApiModel):
    """One page of the audit trail."""

    next_before: Annotated[str | None, Field(examples=["padwatch:117,access:45"])]

    entries: list[AuditEntryModel]
    """Entries of all chains of the audit trail, newest first."""

    head_error: str | None
    """Reason why a file with the newest hash could not be written; null if all were written. The
    entries themselves are stored in both cases."""


TEXTS = (
    *("actor", "source", "peer", "action", "object", "before", "after", "reason"),
    *("previous_hash", "hash"),
)

Page = Sequence[tuple[str, AuditEntry]]
"""Entries with the names of their chains."""


def audit_table(page: Page) -> list[Column]:
    """Return audit entries as table columns; states before and after the action are JSON texts."""
    entries = [entry for _, entry in page]
    return [
        Column("chain", "text", [chain for chain, _ in page]),
        Column("number", "count", [entry.number for entry in entries]),
        Column("time_utc", "time", [entry.time_ns for entry in entries]),
        *(Column(name, "text", [getattr(entry, name) for entry in entries]) for name in TEXTS),
    ]


MAX_ENTRIES = 1000

NUMBER = "[a-z]{1,16}:[1-9][0-9]{0,14}"
Cursor = Annotated[
    str | None,
    parameter(
        "Only entries after `next_before` of the previous page.",
        "padwatch:117,access:45",
        pattern=f"^{NUMBER}(,{NUMBER})?$",
        max_length=80,
    ),
]


def read_page(
    chains: Mapping[str, AuditStore], query: AuditQuery, before: Mapping[str, int]
) -> tuple[Page, str | None]:
    """Return one page of the entries of all chains, newest first, and the cursor of the next page.

    `query` selects entries of each chain, and its limit is the maximum number of entries in the
    page. `before` is an entry number by chain; the page has only entries with smaller numbers.
    """
    found = {}
    for name, audit in chains.items():
        newest = before.get(name, query.before)
        found[name] = audit.entries(replace(query, limit=query.limit + 1, before=newest))
    merged = list(by_time(found.items(), newest_first=True))
    page = merged[: query.limit]
    if len(merged) == len(page):
        return page, None
    # a chain without an entry on this page continues with its newest entry
    numbers = {name: entries[0].number + 1 for name, entries in found.items() if entries}
    numbers |= {name: entry.number for name, entry in page}
    return page, ",".join(f"{name}:{number}" for name, number in numbers.items())


def audit_router(context: Context) -> GuardedRouter:
    """Return the router for the audit trail."""
    router = subject_router("/audit", "audit", Permission.READ_AUDIT)
    chains = {each.chain: each for each in (context.store.audit, context.access.store.audit)}

    @router.get("", response_model=AuditModel, responses=table_content("Audit trail"))
    async def audit_trail(
        query: Annotated[AuditQuery, Depends(audit_query)], wanted: Format, before: Cursor = None
    ) -> Response:
        """List audit entries with actor, action, object and state, newest first, in pages.

        As CSV or Parquet: one row per entry; states before and after the action are JSON texts.
        """
        pairs = (each.partition(":") for each in before.split(",")) if before else ()
        numbers = {name: int(number) for name, _, number in pairs}
        page, cursor = await asyncio.to_thread(read_page, chains, query, numbers)
        if wanted == "json":
            own = (each.head_error for each in chains.values())
            errors = [each for each in (context.plant().audit_error, *own) if each]
            return await rendered(
                lambda: AuditModel(
                    entries=[AuditEntryModel.of(entry, chain=chain) for chain, entry in page],
                    next_before=cursor,
                    head_error="; ".join(errors) or None,
                )
            )
        return table_response(wanted, audit_table(page), "audit", cursor)

    return router


async def audit_query(
    times: OptionalTimeRange,
    actor: Annotated[str | None, only("actor", "A. Name", MAX_NAME)] = None,
    action: Annotated[str | None, only("action", "alarm.shelved", MAX_NAME)] = None,
    object: Annotated[  # noqa: A002  the name that callers know
        str | None, only("object", "U1:ujb_shaft_x:channel_not_ok", MAX_NAME)
    ] = None,
    limit: Annotated[int, at_most(MAX_ENTRIES, "entries in the answer")] = 100,
) -> AuditQuery:
    """Return the query for audit entries from the checked query parameters."""
    start_ns, end_ns = times
    return AuditQuery(
        limit=limit,
        actor=actor,
        action=action,
        object=object,
        start_ns=max(start_ns, AuditQuery.start_ns),
        end_ns=min(end_ns, AuditQuery.end_ns),
    )
