"""Where results are kept."""

from pathlib import Path

from service.settings.plant import PlantFile
from service.store.port import Store
from service.store.sqlite import SqliteStore

DATABASE = "padwatch.sqlite3"


def database_path(plant: PlantFile) -> Path:
    """Where the plant's database is, or would be."""
    return Path(plant.service.data_folder) / DATABASE


def open_store(plant: PlantFile) -> Store:
    """The plant's database, created if need be."""
    return SqliteStore(database_path(plant))
