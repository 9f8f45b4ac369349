"""Where in a plant file a key stands, so that a mistake can be named with its line."""

import re
from collections.abc import Iterator
from typing import TypeAlias

Location: TypeAlias = tuple[int | str, ...]
"""Keys, and after each array the number of the element."""

HEADER = re.compile(r"^\s*(\[\[?)\s*([A-Za-z0-9_.\"-]+?)\s*\]\]?\s*(?:#.*)?$")
KEY = re.compile(r"^\s*([A-Za-z0-9_.-]+)\s*=")


def line_of(location: Location, text: str) -> int:
    """Line of a key, or of the innermost table around it that stands on a line of its own."""
    lines = dict(_lines(text))
    starts = (location[:n] for n in range(len(location), 0, -1))
    return next((lines[start] for start in starts if start in lines), 1)


def _lines(text: str) -> Iterator[tuple[Location, int]]:
    """Line numbers of tables and keys, as far as they stand at the start of a line."""
    table: Location = ()
    counts: dict[Location, int] = {}
    for number, line in enumerate(text.split("\n"), start=1):
        if header := HEADER.match(line):
            table = _table_location(header[2].split("."), header[1] == "[[", counts)
            yield table, number
            if table[-1] == 0:
                yield table[:-1], number
        elif key := KEY.match(line):
            yield (*table, *key[1].split(".")), number


def _table_location(names: list[str], is_array: bool, counts: dict[Location, int]) -> Location:
    """Where a header leads: names, and after each array of tables the number of its element."""
    location: Location = ()
    for position, name in enumerate(names):
        location = (*location, name.strip('"'))
        if is_array and position == len(names) - 1:
            counts[location] = counts.get(location, -1) + 1
        if location in counts:
            location = (*location, counts[location])
    return location
