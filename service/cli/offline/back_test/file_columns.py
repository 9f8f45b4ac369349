"""Columns of a file of readings, and the schema that the reading process sends them in."""

from collections.abc import Iterator, Sequence
from typing import Any

import pyarrow as pa

from service.cli.offline.back_test.problems import shown

TIME, TIME_NS, LINE = "time", "time_ns", "line"
NAMES, OPTIONAL_NAMES = ("unit", "bearing", "direction", "quality"), ("state", "reason")
STIFFNESS = ("k_n_per_m", "u_random")
PER_BEARING = (
    *("eccentricity_ratio", "oil_temperature_c", "speed_rpm", "power_mw"),
    *("u_eccentricity", "attitude_deg"),
)
"""Columns that are the same for both directions."""

AMPLITUDES = ("shaft_um_pk", "bearing_um_pk")
NUMBERS = (*STIFFNESS, *PER_BEARING, *AMPLITUDES)
REQUIRED = (*NAMES, *STIFFNESS, "eccentricity_ratio", "oil_temperature_c")
"""Columns that a file must have beside the time; missing numbers of the others are NaN."""

TEXTS = (*NAMES, *OPTIONAL_NAMES)
HEADINGS = (TIME, *NAMES, *NUMBERS, *OPTIONAL_NAMES)
"""In the order in which padwatch writes them."""

SILENT = "insufficient_excitation"
"""Quality, or reason, of a reading without enough motion to measure stiffness."""

MAX_COLUMNS = 100
MAX_ROWS = 40_000_000
"""Of one file: 20 units of 3 bearings for 6 years; about 230 bytes of memory each."""


class ReadingsError(Exception):
    """A file of readings that cannot be used; the message says where it is wrong."""


def check_headings(headings: Sequence[str]) -> None:
    """Refuse headings that are missing, unknown or repeated.

    Raises
    ------
    ReadingsError
        Naming them.
    """
    if len(headings) > MAX_COLUMNS:
        raise ReadingsError(f"{len(headings)} columns; at most {MAX_COLUMNS} are read")
    problems = list(_problems(headings))
    if problems:
        raise ReadingsError("; ".join(problems))


def schema_of(headings: Sequence[str]) -> Any:
    """Schema of the rows of a file with these headings."""
    texts = [(key, pa.string()) for key in TEXTS if key in headings]
    numbers = [(key, pa.float64()) for key in NUMBERS if key in headings]
    return pa.schema([(TIME_NS, pa.int64()), *texts, *numbers, (LINE, pa.int64())])


def _problems(headings: Sequence[str]) -> Iterator[str]:
    missing = [key for key in REQUIRED if key not in headings]
    if TIME not in headings and TIME_NS not in headings:
        missing.insert(0, f"{TIME} or {TIME_NS}")
    if missing:
        yield f"missing columns: {', '.join(missing)}"
    unknown = [heading for heading in headings if heading not in (TIME_NS, *HEADINGS)]
    if unknown:
        yield f"unknown columns: {_listed(unknown)}; known are {TIME_NS}, {', '.join(HEADINGS)}"
    twice = sorted({heading for heading in headings if headings.count(heading) > 1})
    if twice:
        yield f"columns that are there twice: {_listed(twice)}"
    if TIME in headings and TIME_NS in headings:
        yield f"both {TIME} and {TIME_NS}; one of them is the time"


def _listed(names: list[str]) -> str:
    return ", ".join(shown(name) for name in names[:10]) + (", …" if len(names) > 10 else "")
