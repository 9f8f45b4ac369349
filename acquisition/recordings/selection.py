"""Which columns of a recording a unit needs, found by channel id; a misfit is refused."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from acquisition.delivery.calibration import UnitCalibration
from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import RecordedUnit
from core.machine.unit import Unit


@dataclass(frozen=True)
class Selection:
    """Columns of a recording in the order in which they are wanted, and how to read them.

    Parameters
    ----------
    channels, slow
        Positions in the recording.
    """

    channels: tuple[int, ...]
    slow: tuple[int, ...]
    calibration: UnitCalibration

    def of(self, raw: RawBlock) -> RawBlock:
        """The selected part of a recorded block."""
        if self.channels == tuple(range(len(raw.ok))) and self.slow == tuple(range(len(raw.slow))):
            return raw
        return replace(
            raw,
            counts=raw.counts[list(self.channels)],
            ok=tuple(raw.ok[n] for n in self.channels),
            slow=tuple(raw.slow[n] for n in self.slow),
        )


def all_of(recorded: RecordedUnit) -> Selection:
    """Everything, as it was recorded."""
    n_channels, n_slow = len(recorded.channels), len(recorded.slow_channels)
    return Selection(tuple(range(n_channels)), tuple(range(n_slow)), recorded.calibration)


def select(recorded: RecordedUnit, unit: Unit, slow_units: Mapping[str, str]) -> Selection:
    """Find what a unit needs in a recording, read with the calibration of the recording.

    Parameters
    ----------
    slow_units
        Unit of each slow channel wanted, by id, in the order wanted.

    Raises
    ------
    ConfigError
        If the rates differ, or a channel is missing or in another unit; the message has both.
    """
    if recorded.rate_hz != unit.rate_hz:
        raise ConfigError(
            f"the recording has {recorded.rate_hz:.9g} Hz, unit {unit.id} is configured for"
            f" {unit.rate_hz:.9g} Hz"
        )
    measurands = {c.id: c.measurand.value for c in recorded.channels}
    units = {c.id: c.unit for c in recorded.slow_channels}
    wanted = {c.id: c.measurand.value for c in unit.channels}
    channels = _positions(measurands, wanted, f"unit {unit.id}", "channel")
    slow = _positions(units, slow_units, f"unit {unit.id}", "slow channel")
    calibration = recorded.calibration
    return Selection(
        channels,
        slow,
        replace(
            calibration,
            unit=unit.id,
            channels=tuple(calibration.channels[n] for n in channels),
            slow=tuple(calibration.slow[n] for n in slow),
        ),
    )


def _positions(
    recorded: Mapping[str, str], wanted: Mapping[str, str], owner: str, kind: str
) -> tuple[int, ...]:
    missing = [id_ for id_ in wanted if id_ not in recorded]
    if missing:
        raise ConfigError(
            f"{owner} needs {kind} {_listed(missing)}, the recording has {_listed(recorded)}"
        )
    for id_, unit in wanted.items():
        if recorded[id_] != unit:
            raise ConfigError(
                f"{kind} {id_} is recorded as {recorded[id_]}, {owner} is configured for {unit}"
            )
    ids = list(recorded)
    return tuple(ids.index(id_) for id_ in wanted)


def _listed(ids: Iterable[str]) -> str:
    return ", ".join(ids) or "none"
