"""Learned baselines into files, one each."""

from collections.abc import Iterator
from pathlib import Path

from service.cli.offline.back_test.running import Found
from service.store.documents import to_json


def export_baselines(found: Found, folder: Path) -> int:
    """Write everything that was learned into a new folder; return how many files.

    Raises
    ------
    OSError
        If the folder exists, or cannot be written.
    """
    folder.mkdir(parents=True)
    files = list(_files(found))
    for name, text in files:
        (folder / name).write_text(text, encoding="utf-8")
    return len(files)


def _files(found: Found) -> Iterator[tuple[str, str]]:
    for baseline in found.baselines:
        of = baseline.origin
        yield f"{of.unit}-{of.bearing}-v{of.version}.json", to_json(baseline)
    for unit, number, response in found.responses:
        yield f"{unit}-shaft-response-v{number}.json", to_json(response)
