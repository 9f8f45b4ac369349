"""The edition of the dashboard: an open page knows by it when it has become old."""

import hashlib
from functools import cache
from importlib.metadata import version

from service.dashboard.assets import pages


@cache
def edition() -> str:
    """The versions of program and chart library and the files in short: ``0.6.0-1f2e3d4c``."""
    tags = "".join(f"{path} {asset.etag}" for path, asset in sorted(pages().items()))
    tags += version("plotly")
    return f"{version('padwatch')}-{hashlib.sha256(tags.encode()).hexdigest()[:8]}"
