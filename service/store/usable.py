"""Whether a database file can be used at all, and if not, what to do about it, in one sentence."""

import os
import pwd
from pathlib import Path

BESIDE = ("-wal", "-shm", ".lock")
"""Ends of the names of files that are kept beside the database."""


def why_unusable(path: Path) -> str | None:
    """Why a database cannot be kept there; None if nothing is known against it.

    A folder that is not there is made. An empty file is a new database: whether there was another
    one, the high-water mark beside it says.
    """
    folder = path.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        is_directory, is_other = path.is_dir(), path.exists() and not path.is_file()
    except (FileExistsError, NotADirectoryError):
        return f"{folder} cannot be a folder, for a file is in its place: move it away"
    except PermissionError:
        return f"{_user()} may not look into or make the folder {folder}: {_give(folder)}"
    if is_directory:
        return f"{path} is a folder: move it away, the database is to be a file of that name"
    if is_other:
        return f"{path} is no plain file: move it away"
    return _why_protected(path)


def _why_protected(path: Path) -> str | None:
    folder = path.parent
    if os.statvfs(folder).f_flag & os.ST_RDONLY:
        return f"{folder} is on a file system that is mounted read-only: mount it for writing"
    if not _may(folder, os.W_OK | os.X_OK):
        return f"{_user()} may not make files in {folder}: {_give(folder)}"
    for file in (path, *(path.with_name(path.name + end) for end in BESIDE)):
        if file.exists() and not _may(file, os.R_OK | os.W_OK):
            return f"{_user()} may not read and write {file}: {_give(file)}"
    return None


def _may(path: Path, what: int) -> bool:
    return os.access(path, what, effective_ids=os.access in os.supports_effective_ids)


def _give(path: Path) -> str:
    return f"give it to that user (chown) and let it be written to (chmod u+rwX {path})"


def _user() -> str:
    number = os.geteuid()
    try:
        return f"the user {pwd.getpwuid(number).pw_name}"
    except KeyError:
        return f"the user with number {number}"
