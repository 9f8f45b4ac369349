"""Where results are kept."""

from pathlib import Path
from typing import TYPE_CHECKING

from service.settings.origin import Origin
from service.settings.plant import PlantFile
from service.settings.spectra import SpectraSettings
from service.store.access.audit_verification import head_path
from service.store.audit import Trail
from service.store.outbox import Address, nobody
from service.store.port import Store
from service.store.spectra_port import SpectraLimits, TierLimits
from service.store.sqlite import SqliteStore
from service.store.sqlite.trail import file_trail

if TYPE_CHECKING:
    from service.store.postgres.address import PostgresAddress

DATABASE = "padwatch.sqlite3"


def database_path(plant: PlantFile) -> Path:
    """Where the plant's database is, or would be."""
    return Path(plant.service.data_folder) / DATABASE


def has_store(plant: PlantFile) -> bool:
    """Whether there is a database already; one of a server has to be."""
    return plant.store.postgresql is not None or database_path(plant).exists()


def store_name(plant: PlantFile) -> str:
    """What the plant's database is called in messages."""
    if plant.store.postgresql is not None:
        return _postgres_address(plant, plant.store.postgresql).name
    return str(database_path(plant).absolute())


def head_file(plant: PlantFile) -> Path:
    """File on this host that names the newest entry of the audit trail."""
    if plant.store.postgresql is not None:
        return head_path(Path(plant.service.data_folder) / "postgresql")
    return head_path(database_path(plant))


def open_store(plant: PlantFile, origin: Origin = Origin.LIVE, address: Address = nobody) -> Store:
    """The plant's database: a file, created if need be, or a database of a PostgreSQL server.

    Parameters
    ----------
    address
        Who is to be told of events of alarms.

    Raises
    ------
    StoreError
        If it cannot be used, or holds results of the other origin.
    """
    spectra = spectra_limits(plant.spectra)
    if plant.store.postgresql is None:
        return SqliteStore(database_path(plant), origin, address, spectra)
    from service.store.postgres import PostgresStore  # only here: it takes a while to load

    where = _postgres_address(plant, plant.store.postgresql)
    return PostgresStore(where, head_file(plant), origin, address, spectra)


def open_trail(plant: PlantFile) -> Trail:
    """The audit trail of the plant's database, for those who only read it."""
    if plant.store.postgresql is None:
        return file_trail(database_path(plant))
    from service.store.postgres.trail import server_trail

    return server_trail(_postgres_address(plant, plant.store.postgresql), head_file(plant))


def _postgres_address(plant: PlantFile, conninfo: str) -> "PostgresAddress":
    from service.store.postgres.address import PostgresAddress

    return PostgresAddress(conninfo, plant.store.password_path)


def spectra_limits(settings: SpectraSettings) -> SpectraLimits:
    """How many spectra are kept."""
    return SpectraLimits(
        TierLimits(settings.dense_every_s, settings.n_dense),
        TierLimits(settings.sparse_every_s, settings.n_sparse),
        settings.n_lines,
    )
