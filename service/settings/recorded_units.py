"""What a recording says of the unit that it is of."""

from acquisition.recordings.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from service.settings.units import UnitSettings


def recorded_unit(unit: UnitSettings) -> RecordedUnit:
    """Channels and calibration of a unit as they stand in the manifest of its recordings."""
    return RecordedUnit(
        unit=unit.id,
        rate_hz=unit.sampling_hz,
        channels=tuple(
            RecordedChannel(id=channel.id, measurand=channel.measurand, **channel.scale)
            for channel in unit.channel
        ),
        slow_channels=tuple(RecordedSlowChannel(**slow.model_dump()) for slow in unit.slow_channel),
        block_samples=unit.block_samples,
    )
