"""What the API answers about the shaft centre over time."""

from service.api.models import ApiModel, LevelName, Time


class CentreColumnModel(ApiModel):
    """One quantity of the shaft centre; a value for each time."""

    mean: list[float | None]
    """Mean of the usable readings; null if there is none."""

    u_random: list[float | None]
    """Mean random standard uncertainty."""

    u_systematic: list[float | None]
    """Mean systematic standard uncertainty."""

    worst_level: list[LevelName | None]
    """Worst quality; null where there was no reading at all."""


class CentreLineModel(ApiModel):
    """Where the shaft's centre was in its bearing, oldest first, by column."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    start: Time
    """First time asked for."""

    end: Time
    """Time up to which was asked."""

    clearance_um: float
    """Radius of the circle that the centre can move in, µm."""

    bucket_s: float | None
    """Width of the buckets; null if each reading stands alone."""

    simulated_until: Time | None
    """Until when readings are simulated, not measured; null where all in this range are
    measured."""

    time: list[float]
    """Seconds since 1970 UTC: of each reading, or of the start of each bucket."""

    x_um: CentreColumnModel
    """Shaft centre in x, µm."""

    y_um: CentreColumnModel
    """Shaft centre in y, µm."""

    eccentricity_ratio: CentreColumnModel
    """Its distance from the bearing's centre over the clearance."""

    attitude_angle_deg: CentreColumnModel
    """Its direction, degrees."""
