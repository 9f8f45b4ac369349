"""Reference of settings, generated from the models that check them."""

from collections.abc import Iterator, Mapping
from typing import Any

from padwatch_reference.examples import Examples, examples
from padwatch_reference.schema import ROOT, Node, Table, submodels, tables
from padwatch_reference.words import code, literal, type_words
from service.settings.plant import plant_file_schema
from service.settings.sources.mapping import ImportMapping

HEAD = "| Key | Meaning | Type and limits | Default | Example |\n|---|---|---|---|---|"


def plant_markdown() -> str:
    """Return the reference of a plant file."""
    return schema_markdown(plant_file_schema())


def import_markdown() -> str:
    """Return the reference of a mapping file for imports."""
    return schema_markdown(ImportMapping.model_json_schema())


def schema_markdown(schema: Node) -> str:
    """Write a chapter for each table of a schema."""
    shown, found = examples(schema), tables(schema)
    names = {table.model: table.headers[0] for table in found}
    return "\n\n".join(_chapter(schema, table, shown, names) for table in found) + "\n"


def _chapter(schema: Node, table: Table, shown: Examples, names: Mapping[str, str]) -> str:
    first, *others = table.headers
    heading = "Top level" if first == ROOT else f"`{first}`"
    rows = "\n".join(_rows(schema, table, shown, names))
    also = "Also at " + ", ".join(f"`{header}`" for header in others) + "." if others else ""
    parts = (f"({table.anchor})=\n## {heading}", _line(table.node), also, f"{HEAD}\n{rows}")
    return "\n\n".join(part for part in parts if part)


def _rows(schema: Node, table: Table, shown: Examples, names: Mapping[str, str]) -> Iterator[str]:
    required = table.node.get("required", ())
    for key, node in table.node["properties"].items():
        cells = (
            code(key),
            _line(node).replace("|", "\\|"),
            _type(schema, node, names),
            "required" if key in required else _default(schema, node),
            _example(schema, table.model, key, node, shown),
        )
        yield "| " + " | ".join(cells) + " |"


def _line(node: Node) -> str:
    text = " ".join(str(node.get("description", "")).split())
    return text.replace("<", "&lt;").replace("*", "\\*")


def _type(schema: Node, node: Node, names: Mapping[str, str]) -> str:
    links = [f"[`{names[model]}`](#table-{model.lower()})" for model, _ in submodels(schema, node)]
    return " or ".join([words for words in (type_words(schema, node),) if words] + links)


def _default(schema: Node, node: Node) -> str:
    value = node.get("default")
    if value is None:
        return "not set"
    if list(submodels(schema, node)):
        return "the defaults there" if value else "none"
    return code(literal(value))


def _example(schema: Node, model: str, key: str, node: Node, shown: Examples) -> str:
    """Return an example, unless the description contains one."""
    if "xample" in str(node.get("description", "")):
        return "see meaning"
    if list(submodels(schema, node)):
        return "see there"
    value: Any = shown.get((model, key), node.get("const", node.get("default")))
    if value is None:
        value = next(_choices(schema, node), None)
    return "" if value is None else code(literal(value))


def _choices(schema: Node, node: Node) -> Iterator[Any]:
    for option in (node, *node.get("anyOf", ())):
        if "$ref" in option:
            option = schema["$defs"][str(option["$ref"]).rsplit("/", 1)[-1]]
        yield from option.get("enum", ())
