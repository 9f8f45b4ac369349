"""Documentation: command lines that work, links that lead somewhere, a complete reference."""

import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest
import typer
from rigs.command_line import padwatch

from service.cli.commands import app
from service.settings.alarm_kinds import ALARM_KINDS
from service.settings.plant import plant_file_schema
from service.settings.sources.mapping import ImportMapping

FENCE = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`(?:\.venv/bin/)?padwatch ([a-z][^`]*)`")
CALL = re.compile(r"(?:^|\| *)(?:\.venv/bin/)?padwatch .*")
ENDS = (">", "|", "&&", ";", "2>")


@cache
def command_line() -> Any:
    return typer.main.get_command(app)


def lines(text: str) -> Iterator[list[str]]:
    """Arguments of every `padwatch` line in the shell examples of a page."""
    for fence in FENCE.findall(text):
        for line in fence.replace("\\\n", " ").splitlines():
            if found := CALL.search(line):
                words = shlex.split(found[0].lstrip("| "), comments=True)
                stop = next((n for n, word in enumerate(words) if word in ENDS), len(words))
                yield words[1:stop]


def parsed(arguments: list[str]) -> None:
    """Parse as the command line would, up to the files that are not there."""
    command, context = command_line(), None
    while hasattr(command, "commands"):
        name, *arguments = arguments
        assert name in command.commands, f"no such command as {name}"
        context = command.context_class(command, info_name=name, parent=context)
        command = command.commands[name]
    try:
        command.make_context(name, list(arguments), parent=context)
    except Exception as refusal:
        if "does not exist" not in str(refusal):
            raise AssertionError(f"{name} {arguments}: {refusal}") from refusal


def test_command_lines_in_examples_are_taken(pages):
    for page in pages:
        for arguments in lines(page.read_text(encoding="utf-8")):
            parsed(arguments)


def test_commands_named_in_sentences_exist(pages):
    for words in [words for page in pages for words in INLINE.findall(text_of(page))]:
        command = command_line()
        for word in words.split():
            if not hasattr(command, "commands"):
                break
            for name in word.split("|"):
                assert name in command.commands, f"padwatch {words}: no such command as {name}"
            command = command.commands[word.split("|")[0]]
        known = {option for each in getattr(command, "params", ()) for option in each.opts}
        for option in re.findall(r"--[a-z-]+", words):
            assert option in {*known, "--help"}, f"padwatch {words}: no such option as {option}"


LINK = re.compile(r"\]\((?!https?:|mailto:|#table-)([^)\s]+)\)")
ANY_FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^#{1,6} +(.+?) *$", re.MULTILINE)


@cache
def text_of(page: Path) -> str:
    return ANY_FENCE.sub("", page.read_text(encoding="utf-8"))


@cache
def anchors_of(page: Path) -> set[str]:
    """Names of the places on a page, as forges and MyST make them of headings."""
    headings = HEADING.findall(text_of(page))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_links_on_pages_lead_somewhere(pages):
    for page, link in [(each, link) for each in pages for link in LINK.findall(text_of(each))]:
        path, _, anchor = unquote(link).partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{page}: {link} leads nowhere"
        if anchor.startswith("table-"):  # of tables that are made when the documentation is built
            assert target.parent.name == "reference"
        elif anchor:
            assert anchor in anchors_of(target), f"{page}: {link}: no such heading"


def test_images_have_words_for_those_who_cannot_see_them(pages):
    for page in pages:
        for words, image in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", text_of(page)):
            assert words, f"{page}: {image} has no words"


REFERENCE = Path(__file__).parents[2] / "docs" / "reference"


def filled_page(name: str) -> str:
    from padwatch_reference import filled

    return filled((REFERENCE / name).read_text(encoding="utf-8"))


def test_the_page_about_alarms_lists_every_kind():
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
    ("name", "schema_of"),
    [
        ("configuration.md", plant_file_schema),
        ("import-mapping.md", ImportMapping.model_json_schema),
    ],
    ids=["plant file", "import mapping"],
)
def test_every_key_is_explained_with_its_limits_and_default(name, schema_of):
    page, schema = filled_page(name), schema_of()
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


def test_every_command_is_on_the_page_of_commands():
    from padwatch_reference.commands import commands

    page = filled_page("commands.md")
    names = [path for path, _, _ in commands()]
    assert {"padwatch run", "padwatch config check", "padwatch recording export"} < set(names)
    for name, command, context in commands():
        assert f"## `{name}`" in page
        for parameter in command.get_params(context):
            record = parameter.get_help_record(context)
            assert record is None or f"`{record[0]}`".replace("|", "\\|") in page


def test_every_command_has_help_in_which_no_word_is_lost():
    from padwatch_reference.commands import commands

    for name, command, _ in commands():
        result = padwatch(*name.split()[1:], "--help")
        assert result.exit_code == 0, name
        shown = "".join(result.stdout.split())
        for parameter in command.params:
            words = getattr(parameter, "help", None) or ""
            assert "".join(words.split()) in shown, f"{name} {parameter.name}"
