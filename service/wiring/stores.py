"""Where results are kept."""

from pathlib import Path

from service.origin import Origin
from service.settings.plant import PlantFile
from service.store.port import Store
from service.store.sqlite import SqliteStore

DATABASE = "padwatch.sqlite3"


def database_path(plant: PlantFile) -> Path:
    """Where the plant's database is, or would be."""
    return Path(plant.service.data_folder) / DATABASE


def open_store(plant: PlantFile, origin: Origin = Origin.LIVE) -> Store:
    """The plant's database, created if need be.

    Raises
    ------
    StoreError
        If it cannot be used, or holds results of the other origin.
    """
    return SqliteStore(database_path(plant), origin)
