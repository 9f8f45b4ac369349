"""How a device's clock stands against the host's."""

from dataclasses import dataclass
from enum import StrEnum


class StampFault(StrEnum):
    """What is wrong with a device's time stamp; the names become counters."""

    REGRESSED = "stamp_regressed"
    REPEATED = "stamp_repeated"
    JUMPED = "stamp_jumped"


@dataclass(frozen=True)
class DeviceClock:
    """A device's clocks, as seen from the host's.

    Parameters
    ----------
    offset_s
        How far the device's stamps are ahead of the host's clock, at the least delay seen on the
        way; None if the device does not stamp.
    drift_ppm
        How much faster than nominal the device samples by the host's clock, in parts per million;
        None until there is enough to tell, and where the host says when to sample.
    u_drift_ppm
        Its standard uncertainty.
    n_faults
        Blocks since the start whose own stamp was not used.
    """

    offset_s: float | None
    drift_ppm: float | None
    u_drift_ppm: float | None
    n_faults: int = 0
