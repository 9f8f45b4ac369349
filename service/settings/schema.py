"""The plant file's JSON schema, and what it says about one key."""

from collections.abc import Sequence
from functools import cache
from typing import Any

from service.settings.plant import PlantFile


@cache
def plant_file_schema() -> dict[str, Any]:
    """JSON schema of a plant file, with meaning, limits and defaults of every key."""
    return PlantFile.model_json_schema()


def description(location: Sequence[int | str]) -> str:
    """Meaning of a key, in one line; empty if it is unknown."""
    node: dict[str, Any] = plant_file_schema()
    text = ""
    for part in location:
        step = _step(node, part)
        if step is None:
            return ""
        text = str(step.get("description", ""))
        node = step
    return " ".join(text.split())


def known_keys(location: Sequence[int | str]) -> list[str]:
    """Keys that a table of the plant file may have."""
    node: dict[str, Any] | None = plant_file_schema()
    for part in location:
        node = _step(node, part) if node is not None else None
    return sorted({key for option in _options(node or {}) for key in option.get("properties", {})})


def _step(node: dict[str, Any], part: int | str) -> dict[str, Any] | None:
    for option in _options(node):
        if isinstance(part, int) and "items" in option:
            items: dict[str, Any] = option["items"]
            return items
        if isinstance(part, str) and part in option.get("properties", {}):
            properties: dict[str, dict[str, Any]] = option["properties"]
            return properties[part]
    return None


def _options(node: dict[str, Any]) -> list[dict[str, Any]]:
    """Follow references and alternatives down to schemas that say something themselves."""
    if "$ref" in node:
        name = str(node["$ref"]).rsplit("/", 1)[-1]
        return _options(plant_file_schema()["$defs"][name])
    alternatives = [*node.get("anyOf", ()), *node.get("oneOf", ())]
    if alternatives:
        return [leaf for option in alternatives for leaf in _options(option)]
    return [node]
