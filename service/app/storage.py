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


def database_path(plant: PlantFile) -> Path:
    """Return the path of the plant's database file; the file need not exist."""
    return Path(plant.service.data_folder) / DATABASE


def access_path(plant: PlantFile) -> Path:
    """Return the path of the file of accounts, sessions and keys; the file need not exist."""
    return Path(plant.service.data_folder) / ACCESS_DATABASE


def has_store(plant: PlantFile) -> bool:
    """Return whether the plant's database exists; always True for PostgreSQL."""
    return plant.store.postgresql is not None or database_path(plant).exists()


def store_name(plant: PlantFile) -> str:
    """Return the name of the plant's database for messages."""
    if plant.store.postgresql is not None:
        return _postgres_address(plant, plant.store.postgresql).name
    return str(database_path(plant).absolute())


def has_access(plant: PlantFile) -> bool:
    """Return whether the database of accounts exists; always True for PostgreSQL."""
    return plant.store.postgresql is not None or access_path(plant).exists()


def access_name(plant: PlantFile) -> str:
    """Return the name of the database of accounts for messages."""
    is_file = plant.store.postgresql is None
    return str(access_path(plant).absolute()) if is_file else store_name(plant)


def head_file(plant: PlantFile) -> Path:
    """Return the path of the head file, a local file with the newest entry of the audit trail."""
    if plant.store.postgresql is not None:
        return head_path(Path(plant.service.data_folder) / "postgresql")
    return head_path(database_path(plant))


def open_store(
    plant: PlantFile, origin: Origin = Origin.LIVE, address: Address = no_recipients
) -> Store:
    """Open the plant's database: a SQLite file, created if missing, or PostgreSQL.

    `address` returns the recipients of the notification of an alarm event. Raises `StoreError` if
    the database cannot be used, or contains results of another origin (live, replay).
    """
    if plant.store.postgresql is None:
        return SqliteStore(database_path(plant), origin, address, plant.spectra)
    from service.store.postgres import PostgresStore  # slow import

    where = _postgres_address(plant, plant.store.postgresql)
    return PostgresStore(where, head_file(plant), origin, address, plant.spectra)


def open_store_to_serve(plant: PlantFile, origin: Origin = Origin.LIVE) -> Store:
    """Open the plant's database for a process that only serves requests.

    A SQLite file is opened read-only; with PostgreSQL operators' commands can be written.

    Raises `StoreError` if the database cannot be used.
    """
    if plant.store.postgresql is None:
        return SqliteReader(database_path(plant))
    return open_store(plant, origin)


def open_access(plant: PlantFile, origin: Origin = Origin.LIVE) -> AccessStore:
    """Open the plant's accounts: a SQLite file of their own, created if missing, or PostgreSQL.

    Raises `StoreError` if the database cannot be used.
    """
    if plant.store.postgresql is None:
        return open_access_file(access_path(plant))
    from service.store.postgres.store import open_server_access

    return open_server_access(
        _postgres_address(plant, plant.store.postgresql), head_file(plant), origin
    )


def open_trails(plant: PlantFile) -> list[Trail]:
    """Open the plant's audit trail, one chain of entries per database, for reading."""
    if plant.store.postgresql is None:
        return [file_trail(database_path(plant)), file_trail(access_path(plant))]
    from service.store.postgres.store import server_trail

    return [server_trail(_postgres_address(plant, plant.store.postgresql), head_file(plant))]


def _postgres_address(plant: PlantFile, conninfo: str) -> "PostgresAddress":
    from service.store.postgres.connection import PostgresAddress

    return PostgresAddress(conninfo, plant.store.password_path)


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
