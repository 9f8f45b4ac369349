"""Command lines in the documentation are ones that padwatch takes."""

import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import typer

from service.cli.commands import app

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


def test_command_lines_in_examples_are_taken(page: Path) -> None:
    for arguments in lines(page.read_text(encoding="utf-8")):
        parsed(arguments)


def test_commands_named_in_sentences_exist(page: Path) -> None:
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    for words in INLINE.findall(text):
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
