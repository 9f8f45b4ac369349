"""`Maker`: who makes bundles, and of which plant."""

from dataclasses import dataclass

from service.settings.configuration import Configuration
from service.settings.plant import PlantFile
from service.settings.storage import Origin


@dataclass(frozen=True)
class Maker:
    """Who makes bundles, and of which plant.

    Parameters
    ----------
    made_by
        Program and its version; the host and its user are nothing for a reader of evidence.
    """

    plant: PlantFile
    configuration: Configuration
    made_by: str
    origin: Origin
