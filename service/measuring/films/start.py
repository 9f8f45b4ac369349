"""The films as the service starts: rules of the plant file, baselines and state of the store."""

from collections.abc import Mapping

from acquisition.clock import Clock
from core.machine.unit import Unit
from service.measuring.films.keeper import FilmKeeper
from service.settings.core_values import film_rules_of
from service.settings.plant import PlantFile
from service.store.film_port import FilmStore


async def film_keeper(
    plant: PlantFile, machines: Mapping[str, Unit], store: FilmStore, clock: Clock
) -> FilmKeeper:
    """Put the keeper of all films together and let it go on where the service stopped.

    Raises
    ------
    StoreError
        If what is stored of films cannot be read.
    """
    rules = {unit.id: film_rules_of(unit, plant.films) for unit in plant.unit}
    keeper = FilmKeeper(machines, rules, plant.films, store, clock)
    await keeper.start()
    return keeper
