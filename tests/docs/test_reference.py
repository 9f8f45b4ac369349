"""The reference pages say everything that the program knows of its keys and commands."""

import re
from pathlib import Path
from typing import Any

import pytest
from rigs.command_line import padwatch

from service.settings.alarm_kinds import ALARM_KINDS
from service.settings.loading import plant_file_schema
from service.settings.sources.mapping import ImportMapping

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"


def filled_page(name: str) -> str:
    from padwatch_reference import filled

    return filled((REFERENCE / name).read_text(encoding="utf-8"))


def test_the_page_about_alarms_lists_every_kind() -> None:
    page = filled_page("../how-to/alarms.md")
    table = page.partition("| Alarm | Subject |")[2].partition("\n\n")[0]
    cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert set(re.findall(r"`(\w+)`", " ".join(cells))) == set(ALARM_KINDS)


def chapter(page: str, model: str) -> str:
    """What stands about one table."""
    found = re.search(rf"^\(table-{model.lower()}\)=\n(.*?)(?=^\(table-|\Z)", page, re.M | re.S)
    assert found, f"nothing about {model}"
    return found[1]


@pytest.mark.parametrize(
    ("name", "schema"),
    [
        ("configuration.md", plant_file_schema()),
        ("import-mapping.md", ImportMapping.model_json_schema()),
    ],
    ids=["plant file", "import mapping"],
)
def test_every_key_is_explained_with_its_limits_and_default(
    name: str, schema: dict[str, Any]
) -> None:
    page = filled_page(name)
    assert "<!-- made when built" not in page
    tables = {schema["title"]: schema, **schema["$defs"]}
    for model, node in tables.items():
        if "properties" not in node:
            continue
        rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", chapter(page, model), re.M))
        assert set(rows) == set(node["properties"])
        for key, about in node["properties"].items():
            meaning, kind, default, _example = re.split(r"(?<!\\) \| ", rows[key] + " ", maxsplit=3)
            assert meaning.strip(), f"{model}.{key} says nothing"
            assert kind.strip(), f"{model}.{key} has no type"
            assert (default == "required") == (key in node.get("required", ()))
            for limit in ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"):
                if limit in about:
                    assert re.search(rf"{about[limit]:,g}".replace("+", r"\+"), kind) or (
                        f"{int(about[limit]):,}" in kind
                    )


def test_every_command_is_on_the_page_of_commands() -> None:
    from padwatch_reference.commands import commands

    page = filled_page("commands.md")
    names = [path for path, _, _ in commands()]
    assert {"padwatch run", "padwatch config check", "padwatch recording export"} < set(names)
    for name, command, context in commands():
        assert f"## `{name}`" in page
        for parameter in command.get_params(context):
            record = parameter.get_help_record(context)
            assert record is None or f"`{record[0]}`".replace("|", "\\|") in page


def test_every_command_has_help_in_which_no_word_is_lost() -> None:
    from padwatch_reference.commands import commands

    for name, command, _ in commands():
        result = padwatch(*name.split()[1:], "--help")
        assert result.exit_code == 0, name
        shown = "".join(result.stdout.split())
        for parameter in command.params:
            words = getattr(parameter, "help", None) or ""
            assert "".join(words.split()) in shown, f"{name} {parameter.name}"
