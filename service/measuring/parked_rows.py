"""`ParkedRows`: a file of what the database refused, so that the rest is stored without it."""

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

FILE = "parked.jsonl"

MAX_BYTES = 16_000_000
"""Of the file; then it is renamed once, and begun anew: a damaged page refuses every result."""


class ParkedRows:
    """One JSON object a line, with the reason; in the data folder, for padwatch's user alone.

    Parameters
    ----------
    path
        Created when something is parked.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def add(self, time_ns: int, refused: Iterable[tuple[object, str]]) -> None:
        """Append rows and why each was refused; on the disk when this returns.

        Raises
        ------
        OSError
            If the disk refuses.
        """
        lines = [
            json.dumps(
                {"time_ns": time_ns, "reason": reason, "kind": type(row).__name__, "row": row},
                default=_plain,
                skipkeys=True,
            )
            for row, reason in refused
        ]
        if self.path.exists() and self.path.stat().st_size > MAX_BYTES:
            self.path.replace(self.path.with_name(self.path.name + ".1"))
        descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        with os.fdopen(descriptor, "a", encoding="ascii") as file:
            file.write("".join(f"{line}\n" for line in lines))
            file.flush()
            os.fsync(file.fileno())


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return str(value)
