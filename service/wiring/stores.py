"""Where results are kept."""

from pathlib import Path

from service.origin import Origin
from service.settings.plant import PlantFile
from service.settings.spectra import SpectraSettings
from service.store.audit import Trail
from service.store.outbox_port import Address, nobody
from service.store.port import Store
from service.store.spectra_port import SpectraLimits, TierLimits
from service.store.sqlite import SqliteStore
from service.store.sqlite.trail import file_trail

DATABASE = "padwatch.sqlite3"


def database_path(plant: PlantFile) -> Path:
    """Where the plant's database is, or would be."""
    return Path(plant.service.data_folder) / DATABASE


def open_store(plant: PlantFile, origin: Origin = Origin.LIVE, address: Address = nobody) -> Store:
    """The plant's database, created if need be.

    Parameters
    ----------
    address
        Who is to be told of events of alarms.

    Raises
    ------
    StoreError
        If it cannot be used, or holds results of the other origin.
    """
    return SqliteStore(database_path(plant), origin, address, spectra_limits(plant.spectra))


def open_trail(plant: PlantFile) -> Trail:
    """The audit trail of the plant's database, for those who only read it."""
    return file_trail(database_path(plant))


def spectra_limits(settings: SpectraSettings) -> SpectraLimits:
    """How many spectra are kept."""
    return SpectraLimits(
        TierLimits(settings.dense_every_s, settings.n_dense),
        TierLimits(settings.sparse_every_s, settings.n_sparse),
        settings.n_lines,
    )
