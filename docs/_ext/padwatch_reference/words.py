"""Types, limits and values of settings in words."""

import datetime
import json
from collections.abc import Mapping
from typing import Any

from pydantic import TypeAdapter

from padwatch_reference.schema import Node
from service.settings.base import Identifier

NAMES = {
    "number": "number",
    "integer": "whole number",
    "string": "text",
    "boolean": "true or false",
}

IDENTIFIER = TypeAdapter(Identifier).json_schema()["pattern"]


def literal(value: object) -> str:
    """Return a value in TOML notation."""
    if isinstance(value, Mapping):
        inside = ", ".join(f"{key} = {literal(item)}" for key, item in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(literal(item) for item in value) + "]"
    if isinstance(value, (datetime.datetime, datetime.date, datetime.time)):
        return value.isoformat().replace("+00:00", "Z")
    return json.dumps(value, ensure_ascii=False)


def code(text: str) -> str:
    """Set as code in a cell of a table."""
    fence = "``" if "`" in text else "`"
    return fence + text.replace("|", "\\|") + fence


def type_words(schema: Node, node: Node) -> str:
    """Return the permitted types and limits of a key, without subtables."""
    if "$ref" in node:
        target = schema["$defs"][str(node["$ref"]).rsplit("/", 1)[-1]]
        return "" if "properties" in target else type_words(schema, target)
    options = [*node.get("anyOf", ()), *node.get("oneOf", ())]
    if options:
        kinds = dict.fromkeys(type_words(schema, option) for option in options)
        return " or ".join(words for words in kinds if words)
    if "const" in node:
        return code(literal(node["const"]))
    if "enum" in node:
        return ", ".join(code(literal(value)) for value in node["enum"])
    return _plain(schema, node)


def _plain(schema: Node, node: Node) -> str:
    kind = node.get("type")
    if kind == "array":
        return _list(schema, node)
    if kind == "object":
        [values] = node.get("patternProperties", {"": {}}).values()
        return f"table of {type_words(schema, values)}{_count(node, 'Properties', 'keys')}"
    if kind == "string":
        return _text(node)
    return NAMES.get(str(kind), "") + _range(node)


def _list(schema: Node, node: Node) -> str:
    if "prefixItems" in node:
        kinds = dict.fromkeys(type_words(schema, item) for item in node["prefixItems"])
        return f"list of {len(node['prefixItems'])}: {'; '.join(kinds)}"
    items = type_words(schema, node.get("items", {}))
    return f"list of {items}{_count(node, 'Items', 'of them')}" if items else ""


def _text(node: Node) -> str:
    words = {"date-time": "date and time", "time": "time of day"}.get(
        node.get("format", ""), "text"
    )
    if node.get("pattern") == IDENTIFIER:
        return "identifier (letters, digits, dot, dash, underscore; at most 32)"
    if "pattern" in node:
        words += f" like {code(node['pattern'])}"
    return words + _count(node, "Length", "characters")


def _count(node: Node, what: str, unit: str) -> str:
    least, most = node.get(f"min{what}"), node.get(f"max{what}")
    if least is not None and most is not None:
        return f", {least} to {most} {unit}" if least != most else f", {least} {unit}"
    if most is not None:
        return f", at most {most} {unit}"
    if least == 1:
        return ", not empty"
    return f", at least {least} {unit}" if least is not None else ""


def _range(node: Node) -> str:
    limits: dict[str, Any] = {
        "at least": node.get("minimum"),
        "above": node.get("exclusiveMinimum"),
        "at most": node.get("maximum"),
        "below": node.get("exclusiveMaximum"),
    }
    return "".join(
        f", {word} {_number(value)}" for word, value in limits.items() if value is not None
    )


def _number(value: float) -> str:
    return f"{int(value):,}" if value == int(value) else f"{value:g}"
