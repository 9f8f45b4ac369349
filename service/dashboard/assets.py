"""Files of the dashboard in memory, with media types, entity tags and a version identifier."""

import gzip
import hashlib
import json
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.metadata import version
from importlib.resources import files
from importlib.resources.abc import Traversable

from service.settings.alarm_kinds import ALARM_KINDS

MEDIA_TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}
"""Media types of served files by suffix; other files are not served."""


@dataclass(frozen=True)
class Asset:
    """File of the dashboard: content and media type."""

    body: bytes
    media_type: str

    @cached_property
    def etag(self) -> str:
        """Entity tag: a hash of the content, in quotation marks."""
        return f'"{hashlib.sha256(self.body).hexdigest()[:32]}"'

    @cached_property
    def gzipped(self) -> bytes:
        """Content of the file, compressed by gzip."""
        return gzip.compress(self.body, mtime=0)


@cache
def pages() -> dict[str, Asset]:
    """Read the files of the dashboard, and generate ``alarm_kinds.js`` from `ALARM_KINDS`.

    Returns
    -------
    dict of str to Asset
        Files by path below ``static/``, for example ``charts/trend.js``.
    """
    kinds = Asset(_alarm_kinds().encode(), MEDIA_TYPES["js"])
    return dict(_below(files("service.dashboard") / "static", "")) | {"alarm_kinds.js": kinds}


@cache
def plotly() -> Asset:
    """Return the JavaScript chart library of the installed plotly package."""
    script = files("plotly") / "package_data" / "plotly.min.js"
    return Asset(script.read_bytes(), MEDIA_TYPES["js"])


@cache
def edition() -> str:
    """Return the edition of the dashboard: program version and hash, such as ``0.6.0-1f2e3d4c``.

    An open page detects an upgrade by comparing its edition with the edition in later answers.
    """
    tags = "".join(f"{path} {asset.etag}" for path, asset in sorted(pages().items()))
    tags += version("plotly")
    return f"{version('padwatch')}-{hashlib.sha256(tags.encode()).hexdigest()[:8]}"


def _alarm_kinds() -> str:
    """Return the source of a JavaScript module with the properties of all alarm kinds, by name."""
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
