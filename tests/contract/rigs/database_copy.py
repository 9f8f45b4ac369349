"""Copies of a database: these open sooner than a new one is made."""

import shutil
from pathlib import Path


def copy_database(database_file: Path, folder: Path) -> Path:
    """Copy a closed database and the marks that lie beside it; return the path of the copy."""
    shutil.copytree(database_file.parent, folder, dirs_exist_ok=True)
    return folder / database_file.name
