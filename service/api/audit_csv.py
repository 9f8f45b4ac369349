"""Export of the audit trail as a CSV file that is safe to open in a spreadsheet."""

import csv
from collections.abc import Iterable
from dataclasses import astuple, fields
from typing import TextIO

from service.runtime.times import rfc3339
from service.store.access.audit_entries import AuditEntry

HEADER = ("time", "chain", *(field.name for field in fields(AuditEntry)))

FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "|", "%", "'", "＝", "＋", "－", "＠")
"""First characters of spreadsheet formulas, and the single quote to make escaping reversible."""


def write_csv(file: TextIO, entries: Iterable[tuple[str, AuditEntry]]) -> int:
    """Write pairs of chain name and audit entry to an open CSV file; return their number.

    Text that a spreadsheet could interpret as a formula is prefixed with a single quote.
    """
    rows = csv.writer(file, quoting=csv.QUOTE_ALL, lineterminator="\r\n")
    rows.writerow(HEADER)
    n_entries = 0
    for chain, entry in entries:
        rows.writerow([rfc3339(entry.time_ns), chain, *map(_cell, astuple(entry))])
        n_entries += 1
    return n_entries


def harmless(text: str) -> str:
    """Return a text escaped against formula injection, with invalid characters replaced."""
    text = text.encode("utf-8", "replace").decode("utf-8").replace("\0", "\ufffd")
    is_formula = text.lstrip(" \u00a0\ufeff").startswith(FORMULA) or text.startswith(FORMULA)
    return f"'{text}" if is_formula else text


def _cell(value: object) -> object:
    if isinstance(value, str):
        return harmless(value)
    return "" if value is None else value
