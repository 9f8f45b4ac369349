"""Analysis of a recording by the live monitor, with results in the models of the API."""

from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Sequence
from typing import Any

from acquisition.source import SampleSource
from core.monitor.assessment import Assessment, AveragingWindow
from core.monitor.monitor import UnitMonitor
from core.monitor.refresh import Refresh
from core.quality import Level, Reason
from core.samples.calibration import UnitCalibration
from core.stiffness.estimators import reported_name
from service.api.values import QualityModel, reading_model, window_model
from service.runtime.times import rfc3339


def assessment_document(assessment: Assessment) -> dict[str, Any]:
    """Return an assessment as a JSON document, in the form of the API's newest result."""
    return {
        "unit": assessment.unit,
        "bearing": assessment.bearing,
        "time": rfc3339(assessment.time_ns),
        "quality": QualityModel.of(assessment.quality),
        "speed_source": assessment.speed_source.value,
        "runout": dict(assessment.runout),
        "window": window_model(assessment.window),
        "estimators": dict(assessment.estimators),
        "readings": {name: reading_model(r) for name, r in assessment.readings.items()},
    }


N_PER_GN = 1e9


def stiffness_lines(assessment: Assessment) -> Iterator[str]:
    """Yield the film stiffness of a bearing in x and y as text, with its 95 % interval.

    The unit is GN/m or, if the stiffness k_b of the bracket is unknown, k_b. A missing or uncertain
    stiffness is shown with the reason.
    """
    for axis in ("xx", "yy"):
        absolute = f"stiffness_{axis}_n_per_m"
        name = reported_name(assessment.readings, absolute)
        reading = assessment.readings[name]
        scale, unit = (N_PER_GN, "GN/m") if name == absolute else (1.0, "k_b")
        words = f"{assessment.unit} {assessment.bearing} film stiffness {axis}: "
        if reading.value is None:
            yield f"{words}not available: {reading.quality.reason.value.replace('_', ' ')}"
            continue
        words += f"{reading.value / scale:.3f}"
        if reading.interval_95 is not None:
            low, high = reading.interval_95
            words += f" ± {(high - low) / 2.0 / scale:.3f} {unit} (95 %)"
        else:
            words += f" {unit}, uncertainty unknown"
        reason = reading.quality.reason
        doubts = {
            Reason.POLARITY: f"check the sign of shaft_{axis[0]} or bearing_{axis[0]}",
            Reason.SWAPPED_AXES: "the shaft whirls backward; check the signs and order of x and y",
        }
        doubt = doubts.get(reason, reason.value.replace("_", " "))
        is_good = reading.quality.level is Level.GOOD
        yield words if is_good else f"{words}, uncertain: {doubt}"


async def refreshes(
    source: SampleSource, monitor: UnitMonitor, passed: Callable[[int], None]
) -> AsyncIterator[Refresh]:
    """Yield the input of each assessment of a finite source; no assessment is computed.

    Parameters
    ----------
    passed
        Called with the number of samples per channel of each analysed block.

    Raises
    ------
    AcquisitionError
        If the source fails.
    """
    async with source.connect() as blocks:
        async for block in blocks:
            for refresh in monitor.refreshes(block):
                yield refresh
            passed(block.n_samples)


def is_full(averaged: AveragingWindow) -> bool:
    """Return whether an average has as many segments as the settings require."""
    return averaged.n_segments >= averaged.n_segments_wanted


class LastAverages:
    """Store of the last full average of each bearing, or of the last average if none is full."""

    def __init__(self) -> None:
        self._kept: dict[str, Refresh] = {}

    def put(self, refresh: Refresh) -> None:
        """Add the next average of a bearing."""
        kept = self._kept.get(refresh.bearing.id)
        if kept is None or is_full(refresh.averaged) or not is_full(kept.averaged):
            self._kept[refresh.bearing.id] = refresh

    def all(self) -> Iterable[Refresh]:
        """Return the newest averages of each bearing, in the order in which bearings appeared."""
        return self._kept.values()


def calibration_differences(
    ids: Sequence[str], recorded: UnitCalibration, configured: UnitCalibration
) -> list[str]:
    """Return messages, one per difference between the recorded and the configured calibration.

    Parameters
    ----------
    ids
        Ids of the waveform channels, common to both calibrations.
    """
    words = []
    for id_, then, now in zip(ids, recorded.channels, configured.channels, strict=True):
        words += [
            f"channel {id_}: {name} was {value:.9g} when recorded, is {vars(now)[name]:.9g} now"
            for name, value in vars(then).items()
            if value != vars(now)[name]
        ]
    for slow, slow_now in zip(recorded.slow, configured.slow, strict=True):
        if slow != slow_now:
            words.append(
                f"slow channel {slow.id}: range was {slow.minimum:g} to {slow.maximum:g},"
                f" is {slow_now.minimum:g} to {slow_now.maximum:g} now"
            )
    return words
