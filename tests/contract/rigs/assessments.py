"""Results of one bearing, as an analysis finds them."""

import numpy as np

from core.monitor.assessment import Assessment, AveragingWindow
from core.monitor.catalogue import CATALOGUE
from core.quality import GOOD, Reading, Reason, missing
from core.spectra.cross_spectrum import average
from core.spectra.speed import SpeedSource


def assessment(
    time_ns: int = 1_767_225_600_000_000_000,
    unit: str = "U1",
    bearing: str = "UJB",
    **readings: Reading | float,
) -> Assessment:
    """An assessment in which only the named readings have a value."""
    given = {
        name: value if isinstance(value, Reading) else Reading(value)
        for name, value in readings.items()
    }
    everything = {q.name: missing(Reason.NOT_MEASURED) for q in CATALOGUE} | given
    nothing = average(np.arange(1.0, 3.0), np.zeros((1, 4, 2), complex), np.ones((1, 4), bool))
    return Assessment(
        unit=unit,
        bearing=bearing,
        time_ns=time_ns,
        window=AveragingWindow(3, 0, 8192, 1, 24, 0, 1.0, 13.653),
        speed_source=SpeedSource.SLOW_CHANNEL,
        quality=GOOD,
        readings=everything,
        budgets={},
        estimators={"xx": None, "yy": None},
        spectrum=nothing,
        orbit=None,
        runout={},
    )
