"""Reference pages that are generated from the program when the documentation is built.

A page of `docs/reference` holds a heading, a word to the reader and a line such as
``<!-- made when built: configuration -->``; that line is replaced as the page is read. Nothing of
it is kept in the repository, so that nothing of it can be out of date. The table of alarms is
written by hand; kinds that it lacks are added from the program's table of alarm kinds.
"""

import re
from collections.abc import Callable, Mapping
from typing import Any

from sphinx.application import Sphinx

from padwatch_reference.commands import commands_markdown
from padwatch_reference.configuration import import_markdown, plant_markdown
from service.settings.alarm_kinds import ALARM_KINDS

MADE: Mapping[str, Callable[[], str]] = {
    "configuration": plant_markdown,
    "import mapping": import_markdown,
    "commands": commands_markdown,
}


FURTHER_ALARMS = "<!-- made when built: further alarms -->"
"""Place at the end of a table of alarm kinds."""


def further_alarms(page: str) -> str:
    """Return table rows for the alarm kinds that a page does not describe."""
    described = set(re.findall(r"`(\w+)`", page))
    return "\n".join(
        f"| `{kind.name}` | {kind.subject} | {kind.label}. {kind.advice} | on |"
        for kind in ALARM_KINDS.values()
        if kind.name not in described
    )


def filled(page: str) -> str:
    """Replace the placeholders of a page by generated text."""
    for name, make in MADE.items():
        place = f"<!-- made when built: {name} -->"
        if place in page:
            page = page.replace(place, make())
    return page.replace(FURTHER_ALARMS, further_alarms(page))


def _fill(_app: Sphinx, _name: str, source: list[str]) -> None:
    source[0] = filled(source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    """Replace the placeholders while Sphinx reads the pages."""
    app.connect("source-read", _fill)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
