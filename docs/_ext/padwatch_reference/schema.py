"""Tables of a JSON schema of settings, and their paths in a TOML file."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

Node = Mapping[str, Any]

ROOT = "the file itself"


@dataclass
class Table:
    """One model of the settings.

    Parameters
    ----------
    headers
        How the table is opened in a file, such as ``[[unit]]``; one for each place it may have.
    """

    model: str
    node: Node
    headers: list[str] = field(default_factory=list)

    @property
    def anchor(self) -> str:
        """Name of its place on the page."""
        return f"table-{self.model.lower()}"


def tables(schema: Node) -> list[Table]:
    """List all tables of a file in the order in which they are met, the file itself first."""
    found: dict[str, Table] = {}
    _collect(schema, Table(str(schema["title"]), schema), (), ROOT, found)
    return list(found.values())


def _collect(
    schema: Node, table: Table, path: tuple[str, ...], header: str, found: dict[str, Table]
) -> None:
    known = found.setdefault(table.model, table)
    if header in known.headers:
        return
    known.headers.append(header)
    for key, node in table.node.get("properties", {}).items():
        below = (*path, key)
        for model, is_list in submodels(schema, node):
            definition = schema["$defs"][model]
            opened = _header(below, definition, is_list)
            _collect(schema, Table(model, definition), below, opened, found)


def submodels(schema: Node, node: Node, is_list: bool = False) -> Iterator[tuple[str, bool]]:
    """Return the models that a key permits, and whether they are in a list."""
    if "$ref" in node:
        model = str(node["$ref"]).rsplit("/", 1)[-1]
        if "properties" in schema["$defs"][model]:
            yield model, is_list
    for option in (*node.get("anyOf", ()), *node.get("oneOf", ())):
        yield from submodels(schema, option, is_list)
    if "items" in node:
        yield from submodels(schema, node["items"], is_list=True)


def _header(path: tuple[str, ...], definition: Node, is_list: bool) -> str:
    name = ".".join(path)
    header = f"[[{name}]]" if is_list else f"[{name}]"
    kind = definition["properties"].get("kind", {}).get("const")
    return f'{header} kind = "{kind}"' if kind else header
