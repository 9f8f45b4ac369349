"""Which data folder this is, as several may share one index."""

import re
import uuid
from pathlib import Path

from service.runtime.files import write_whole

FILE = "place.txt"


def place_of(data_folder: Path) -> str:
    """A name that the data folder keeps for ever; made when it is asked for first.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    path = data_folder / FILE
    try:
        found = path.read_text(encoding="ascii", errors="replace").strip()
        if re.fullmatch(r"[0-9a-f]{32}", found):
            return found
    except FileNotFoundError:
        data_folder.mkdir(parents=True, exist_ok=True)
    name = uuid.uuid4().hex
    write_whole(path, f"{name}\n".encode("ascii"))
    return name
