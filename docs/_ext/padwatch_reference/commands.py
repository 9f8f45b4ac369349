"""Reference of commands and options, generated from the command line."""

from collections.abc import Iterator
from typing import Any

import typer

from padwatch_reference.words import code
from service.cli.commands import app

OPTION_HEAD = "| Argument or option | Meaning |\n|---|---|"


def commands_markdown() -> str:
    """Return every command with its arguments and options."""
    return "\n\n".join(_chapter(*each) for each in commands()) + "\n"


def commands() -> Iterator[tuple[str, Any, Any]]:
    """Yield name, command and context of every command that is not a group."""
    yield from _below(typer.main.get_command(app), "padwatch", None)


def _below(command: Any, name: str, parent: Any) -> Iterator[tuple[str, Any, Any]]:
    context = command.context_class(command, info_name=name, parent=parent)
    subcommands = getattr(command, "commands", {})
    if not subcommands:
        yield context.command_path, command, context
    for sub, its in subcommands.items():
        yield from _below(its, sub, context)


def _chapter(path: str, command: Any, context: Any) -> str:
    usage = " ".join(command.get_usage(context).removeprefix("Usage: ").split())
    records = [parameter.get_help_record(context) for parameter in command.get_params(context)]
    rows = "\n".join(f"| {code(name)} | {_cell(words)} |" for name, words in filter(None, records))
    anchor = path.replace(" ", "-")
    help_text = (command.help or "").strip()
    return (
        f"({anchor})=\n## `{path}`\n\n{help_text}\n\n```text\n{usage}\n```\n\n{OPTION_HEAD}\n{rows}"
    )


def _cell(words: str) -> str:
    words = words.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
    return " ".join(words.split())
