"""Example values of keys from the shipped files and the guides."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from padwatch_reference.schema import Node, submodels

ROOT = Path(__file__).parents[3]

FENCE = re.compile(r"^```toml\n(.*?)^```$", re.MULTILINE | re.DOTALL)

FRAGMENTS = ("RegisterMapSettings", "BearingSettings", "UnitSettings", "ChannelSettings")
"""Separate tables: register maps in their own files, excerpts in the guides."""

Examples = dict[tuple[str, str], Any]
"""The first value found, by model and key."""


def examples(schema: Node) -> Examples:
    """Find a value for as many keys as the files and guides show."""
    found: Examples = {}
    for document in _documents():
        _look(schema, str(schema["title"]), schema, document, found)
        for name in FRAGMENTS:
            if name in schema["$defs"]:
                _look(schema, name, schema["$defs"][name], document, found)
    return found


def _documents() -> Iterator[dict[str, Any]]:
    for path in (ROOT / "deploy" / "plant.toml", *sorted((ROOT / "deploy").rglob("*.toml"))):
        yield tomllib.loads(path.read_text(encoding="utf-8"))
    for path in sorted((ROOT / "docs").rglob("*.md")):
        for fence in FENCE.findall(path.read_text(encoding="utf-8")):
            try:
                yield tomllib.loads(fence)
            except tomllib.TOMLDecodeError:  # an excerpt that leaves something out
                continue


def _look(schema: Node, model: str, node: Node, value: object, found: Examples) -> None:
    if not isinstance(value, Mapping) or not _is_kind(node, value):
        return
    for key, its in value.items():
        if key not in node.get("properties", {}):
            continue
        below = list(submodels(schema, node["properties"][key]))
        if not below:
            found.setdefault((model, key), its)
        for submodel, _ in below:
            for each in its if isinstance(its, list) else [its]:
                _look(schema, submodel, schema["$defs"][submodel], each, found)


def _is_kind(node: Node, value: Mapping[str, Any]) -> bool:
    kind = node.get("properties", {}).get("kind", {}).get("const")
    return kind is None or value.get("kind") == kind
