"""What `padwatch acquire` and `padwatch analyse` share on the command line."""

from service.cli.plant_file import fail
from service.settings.plant import PlantFile
from service.settings.stream import StreamSettings


def stream_settings(plant: PlantFile) -> StreamSettings:
    """The plant file's [stream], or the end of the command."""
    if plant.stream is None:
        fail(
            "padwatch: the plant file has no [stream]: give it one, with the servers of NATS, or"
            " use `padwatch run`, which needs none",
            2,
        )
    return plant.stream
