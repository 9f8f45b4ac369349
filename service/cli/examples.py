"""The example plant files that come with padwatch."""

from pathlib import Path

DEMO = "demo.toml"
DEMO_LIFE = "demo-life.toml"
EXAMPLE = "plant.toml"

PACKAGED = Path(__file__).parent.parent / "deploy"
"""Where a wheel carries them."""

CHECKOUT = Path(__file__).parent.parent.parent / "deploy"
"""Where they are kept."""


def example_path(name: str) -> Path:
    """Path of an example plant file."""
    return next(path for path in (PACKAGED / name, CHECKOUT / name) if path.exists())
