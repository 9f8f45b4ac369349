"""The dashboard's files as bytes in memory, each with its media type and entity tag."""

import gzip
import hashlib
import json
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from importlib.resources.abc import Traversable

from service.settings.alarm_kinds import ALARM_KINDS

MEDIA_TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}
"""Every kind of file that is served, by suffix; anything else in the folder is not."""


@dataclass(frozen=True)
class Asset:
    """One file as it is sent to browsers."""

    body: bytes
    media_type: str

    @cached_property
    def etag(self) -> str:
        """Entity tag that changes whenever a byte of the file does."""
        return f'"{hashlib.sha256(self.body).hexdigest()[:32]}"'

    @cached_property
    def gzipped(self) -> bytes:
        """The same bytes for browsers that accept gzip, compressed once."""
        return gzip.compress(self.body, mtime=0)


@cache
def pages() -> dict[str, Asset]:
    """Read the dashboard's own files, and make those that hold tables of the program.

    Returns
    -------
    dict of str to Asset
        By path below ``static/``, for example ``charts/trend.js``.
    """
    kinds = Asset(_alarm_kinds().encode(), MEDIA_TYPES["js"])
    return dict(_below(files("service.dashboard") / "static", "")) | {"alarm_kinds.js": kinds}


@cache
def plotly() -> Asset:
    """Read the chart library out of the installed plotly package."""
    script = files("plotly") / "package_data" / "plotly.min.js"
    return Asset(script.read_bytes(), MEDIA_TYPES["js"])


def _alarm_kinds() -> str:
    """JavaScript module with the kinds of alarms, by name."""
    table = {
        name: {key: getattr(kind, key) for key in ("label", "subject", "rule", "advice")}
        for name, kind in ALARM_KINDS.items()
    }
    return f"export const ALARM_KINDS = {json.dumps(table, ensure_ascii=False, indent=2)};\n"


def _below(folder: Traversable, prefix: str) -> list[tuple[str, Asset]]:
    found: list[tuple[str, Asset]] = []
    for entry in folder.iterdir():
        suffix = entry.name.rpartition(".")[2]
        if entry.is_dir():
            found += _below(entry, f"{prefix}{entry.name}/")
        elif suffix in MEDIA_TYPES:
            found.append((prefix + entry.name, Asset(entry.read_bytes(), MEDIA_TYPES[suffix])))
    return found
