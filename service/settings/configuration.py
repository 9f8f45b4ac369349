"""Configuration: the settings of the plant file without secrets, identified by their hash."""

import hashlib
import json
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from typing import Any
from urllib.parse import urlsplit

from service.settings.plant import PlantFile

FORMAT = "padwatch-configuration"

LEFT_OUT = "left out"

SECRETS = ("secret", "authorization", "password", "username")
"""Keys of secret values in any table."""


@dataclass(frozen=True)
class Configuration:
    """A configuration and its version, the SHA-256 of its text."""

    text: bytes

    @property
    def version(self) -> str:
        """SHA-256 of the text."""
        return hashlib.sha256(self.text).hexdigest()


def configuration_of(plant: PlantFile, program: str, commit: str | None) -> Configuration:
    """Return the configuration of a plant file without its secrets."""
    settings = without_secrets(plant.model_dump(mode="json"))
    document = {"format": FORMAT, "version": 1, "padwatch": program, "commit": commit}
    return Configuration(canonical(document | {"settings": settings}))


def canonical(document: object) -> bytes:
    """Return the canonical text of a document."""
    text = json.dumps(
        document, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
    )
    return text.encode()


def without_secrets(value: Any) -> Any:
    """Return the settings without secrets."""
    if isinstance(value, dict):
        return {key: _shown(key, each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [without_secrets(each) for each in value]
    return value


def built_from() -> str | None:
    """Return the commit that padwatch was installed from, if known."""
    try:
        text = distribution("padwatch").read_text("direct_url.json")
    except PackageNotFoundError:
        return None
    commit = json.loads(text or "{}").get("vcs_info", {}).get("commit_id")
    return str(commit)[:64] if commit else None


def _shown(key: str, value: Any) -> Any:
    if key in SECRETS and value is not None:
        return LEFT_OUT
    if key == "url" and isinstance(value, str):
        parts = urlsplit(value)  # its path may contain a token
        return f"{parts.scheme}://{parts.hostname}/ ({LEFT_OUT})"
    return without_secrets(value)
