"""What the API answers about the health of a source."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.models import ApiModel
from service.api.plant_models import SourceModel

SourceKind = Literal[
    "modbus_ring", "modbus_fifo", "modbus_polled", "modbus_vector", "can", "simulated"
]


class PollsModel(ApiModel):
    """What asking a device took, with decoding and handing over what it answered."""

    n: int
    """How often it was asked and has answered since the service started."""

    newest_s: Annotated[float, Field(examples=[0.012])]
    """What the newest took."""

    mean_s: Annotated[float, Field(examples=[0.011])]
    """What they took on average."""


class SourceHealthModel(SourceModel):
    """Where the samples of a unit come from, how they arrive and where every one of them went."""

    unit: Annotated[str, Field(examples=["U1"])]
    """Unit."""

    kind: SourceKind
    """How they arrive."""

    n_failed: int
    """How often connecting has failed, or the link was lost, since the service started."""

    rate_hz: float
    """Samples per second and channel."""

    poll_period_s: float | None
    """How often the device is asked; null for one that sends by itself."""

    polls: PollsModel | None
    """What asking it took; null for one that sends by itself, and before the second time."""

    refused_frames: Annotated[dict[str, int], Field(examples=[{"duplicate": 2}])]
    """Frames of a CAN bus that were not used, by reason, since the service started."""
