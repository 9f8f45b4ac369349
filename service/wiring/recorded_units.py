"""What a recording says of the unit that it is of."""

from acquisition.recordings.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from service.settings.units import UnitSettings


def recorded_unit(unit: UnitSettings) -> RecordedUnit:
    """Channels and calibration of a unit as they stand in the manifest of its recordings."""
    return RecordedUnit(
        unit=unit.id,
        rate_hz=unit.sampling_hz,
        channels=tuple(
            RecordedChannel(
                id=channel.id,
                measurand=channel.measurand,
                full_scale_v=channel.full_scale_v,
                unit_per_v=channel.unit_per_v,
                ok_min_v=channel.ok_min_v,
                ok_max_v=channel.ok_max_v,
            )
            for channel in unit.channel
        ),
        slow_channels=tuple(RecordedSlowChannel(**slow.model_dump()) for slow in unit.slow_channel),
        block_samples=unit.block_samples,
    )
