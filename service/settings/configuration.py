"""Configuration document: settings of the plant file without secrets, identified by a hash."""

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
"""Keys whose values are secret, in any table."""


@dataclass(frozen=True)
class Configuration:
    """Configuration document; ``text`` is canonical JSON (UTF-8) without secrets."""

    text: bytes

    @property
    def version(self) -> str:
        """SHA-256 hash of the text, hexadecimal."""
        return hashlib.sha256(self.text).hexdigest()


def configuration_of(plant: PlantFile, program: str, commit: str | None) -> Configuration:
    """Return the configuration document of a plant file, without secrets.

    ``program`` is the version of padwatch; ``commit`` is its Git commit, or None if unknown.
    """
    settings = without_secrets(plant.model_dump(mode="json"))
    document = {"format": FORMAT, "version": 1, "padwatch": program, "commit": commit}
    return Configuration(canonical(document | {"settings": settings}))


def canonical(document: object) -> bytes:
    """Return a document as canonical JSON (sorted keys, no spaces, UTF-8).

    Raises `ValueError` if a number is not finite.
    """
    text = json.dumps(
        document, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
    )
    return text.encode()


def without_secrets(value: Any) -> Any:
    """Return a copy of JSON values with secrets, and the paths of URLs, replaced by `LEFT_OUT`."""
    if isinstance(value, dict):
        return {key: _shown(key, each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [without_secrets(each) for each in value]
    return value


def built_from() -> str | None:
    """Return the Git commit from which padwatch was installed; None if unknown."""
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
        parts = urlsplit(value)  # the path may contain a token
        return f"{parts.scheme}://{parts.hostname}/ ({LEFT_OUT})"
    return without_secrets(value)
