"""The HTTP server of a plant file."""

from urllib.parse import urlsplit

from starlette.types import ASGIApp

from acquisition.clock import Clock
from service.http.config import GuardedConfig
from service.http.server import GuardedServer
from service.settings.plant import PlantFile


def server_of(app: ASGIApp, plant: PlantFile, clock: Clock) -> GuardedServer:
    """What serves an application within the plant file's limits, under the names it gives."""
    config = GuardedConfig(app, plant.service.limits, _names(plant), clock.monotonic_s)
    return GuardedServer(config)


def _names(plant: PlantFile) -> list[str]:
    """Its own names, and the one that people are sent to by messages."""
    names = [plant.service.host, *plant.service.hosts]
    if plant.delivery.dashboard_url is not None:
        names.append(urlsplit(plant.delivery.dashboard_url).hostname or "")
    return [name for name in names if name]
