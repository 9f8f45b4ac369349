"""The example plant files that come with padwatch."""

import sysconfig
from pathlib import Path

DEMO = "demo.toml"
DEMO_LIFE = "demo-life.toml"
EXAMPLE = "plant.toml"

PACKAGED = Path(sysconfig.get_path("data")) / "share" / "padwatch"
"""Where a wheel puts them, with the units and files of `deploy/`."""

CHECKOUT = Path(__file__).parent.parent.parent / "deploy"
"""Where they are kept."""


def example_path(name: str) -> Path:
    """Path of an example plant file."""
    return next(path for path in (CHECKOUT / name, PACKAGED / name) if path.exists())
