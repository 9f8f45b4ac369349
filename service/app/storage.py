"""Databases of a plant file, and the folders of its data."""

from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from service.reports.folders import EvidenceFolders
from service.settings.configuration import Configuration, built_from, configuration_of
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.access.audit_verification import head_path
from service.store.access.tables import AccessStore
from service.store.audit import Trail
from service.store.outbox import Address, no_recipients
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import SqliteReader, file_trail, open_access_file
from service.store.store import Store

if TYPE_CHECKING:
    from service.store.postgres.connection import PostgresAddress

DATABASE, ACCESS_DATABASE = "padwatch.sqlite3", "access.sqlite3"


def database_path(plant: PlantFile, name: str = DATABASE) -> Path:
    """Return the path of a database file of the plant; the file need not exist."""
    return Path(plant.service.data_folder) / name


def access_path(plant: PlantFile) -> Path:
    """Return the path of the file of accounts, sessions and keys; the file need not exist."""
    return database_path(plant, ACCESS_DATABASE)


def has_store(plant: PlantFile, name: str = DATABASE) -> bool:
    """Return whether a database of the plant exists; always True for PostgreSQL."""
    return plant.store.postgresql is not None or database_path(plant, name).exists()


def store_name(plant: PlantFile, name: str = DATABASE) -> str:
    """Return the name of a database of the plant for messages."""
    server = _server(plant)
    return str(database_path(plant, name).absolute()) if server is None else server[0].name


def open_store(
    plant: PlantFile,
    origin: Origin = Origin.LIVE,
    address: Address = no_recipients,
    *,
    only_reads: bool = False,
) -> Store:
    """Open the plant's database: a SQLite file, created if missing, or PostgreSQL.

    `address` returns the recipients of the notification of an alarm event. With `only_reads`, a
    SQLite file is opened read-only; with PostgreSQL operators' commands can be written. Raises
    `StoreError` if the database cannot be used, or contains results of another origin (live,
    replay).
    """
    if (server := _server(plant)) is not None:
        from service.store.postgres import PostgresStore  # slow import

        return PostgresStore(*server, origin, address, plant.spectra)
    path = database_path(plant)
    return SqliteReader(path) if only_reads else SqliteStore(path, origin, address, plant.spectra)


def open_access(plant: PlantFile, origin: Origin = Origin.LIVE) -> AccessStore:
    """Open the plant's accounts: a SQLite file of their own, created if missing, or PostgreSQL.

    Raises `StoreError` if the database cannot be used.
    """
    if (server := _server(plant)) is None:
        return open_access_file(access_path(plant))
    from service.store.postgres.store import open_server_access

    return open_server_access(*server, origin)


def open_trails(plant: PlantFile) -> list[Trail]:
    """Open the plant's audit trail, one chain of entries per database, for reading."""
    if (server := _server(plant)) is None:
        return [file_trail(database_path(plant)), file_trail(access_path(plant))]
    from service.store.postgres.store import server_trail

    return [server_trail(*server)]


def _server(plant: PlantFile) -> "tuple[PostgresAddress, Path] | None":
    """Return the address of the PostgreSQL database and the local head file of its audit trail.

    None if the plant has SQLite files.
    """
    if plant.store.postgresql is None:
        return None
    from service.store.postgres.connection import PostgresAddress

    head = head_path(Path(plant.service.data_folder) / "postgresql")
    return PostgresAddress(plant.store.postgresql, plant.store.password_path), head


CAPTURES, RECORDINGS = "captures", "recordings"


def recordings_folder(plant: PlantFile) -> Path:
    """Return the folder of continuous recordings of a plant."""
    return Path(plant.recording.folder or Path(plant.service.data_folder) / RECORDINGS)


EVIDENCE, CONFIGURATIONS = "evidence", "configurations"


def evidence_folders(plant: PlantFile) -> EvidenceFolders:
    """Return the folders of evidence, captures and configurations of a plant."""
    root = Path(plant.service.data_folder)
    return EvidenceFolders(root / EVIDENCE, root / CAPTURES, root / CONFIGURATIONS)


def built_configuration(plant: PlantFile) -> Configuration:
    """Return the plant file with all defaults and the program version, without secrets."""
    return configuration_of(plant, version("padwatch"), built_from())
