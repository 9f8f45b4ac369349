"""A recording through the same analysis as live samples, and its results in the API's words."""

from collections.abc import AsyncIterator, Callable, Iterable, Sequence

from acquisition.source import SampleSource
from core.monitor.assessment import Assessment, AveragingWindow
from core.monitor.monitor import UnitMonitor
from core.monitor.refresh import Refresh
from core.samples.calibration import UnitCalibration
from service.api.routes.bearings import estimator_names, runout_names
from service.api.values import (
    ApiModel,
    EstimatorName,
    QualityModel,
    ReadingModel,
    RunoutName,
    SpeedSourceName,
    Time,
    WindowModel,
    quality_model,
    reading_model,
    window_model,
)
from service.runtime.times import rfc3339


class AssessmentModel(ApiModel):
    """One bearing at one refresh; the parts are those of the API's ``latest``."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    time: Time
    """End of the samples."""

    quality: QualityModel
    """The worst of the 1× amplitudes and the preferred stiffness."""

    speed_source: SpeedSourceName
    """Where the running speed came from."""

    runout: dict[str, RunoutName | None]
    """Whether runout was taken off 1× of the newest segment, and if not, why."""

    window: WindowModel
    """The samples."""

    estimators: dict[str, EstimatorName | None]
    """Where `stiffness` came from, by axes "xx" and "yy"; null if there is none."""

    readings: dict[str, ReadingModel]
    """All quantities of the catalogue, by name."""


def assessment_model(assessment: Assessment) -> AssessmentModel:
    """An assessment as the API shows its parts, to the last digit."""
    return AssessmentModel(
        unit=assessment.unit,
        bearing=assessment.bearing,
        time=rfc3339(assessment.time_ns),
        quality=quality_model(assessment.quality),
        speed_source=assessment.speed_source.value,
        runout=runout_names(assessment),
        window=window_model(assessment.window),
        estimators=estimator_names(assessment),
        readings={name: reading_model(name, r) for name, r in assessment.readings.items()},
    )


async def refreshes(
    source: SampleSource, monitor: UnitMonitor, passed: Callable[[int], None]
) -> AsyncIterator[Refresh]:
    """All that a monitor learns from a source that comes to an end; assessed on request.

    Parameters
    ----------
    passed
        Called with the number of samples per channel of each block that is done.

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
    """Whether an average has all the segments it wants."""
    return averaged.n_segments >= averaged.n_segments_wanted


class LastAverages:
    """The last full average of each bearing; the last one of all while none is full."""

    def __init__(self) -> None:
        self._kept: dict[str, Refresh] = {}

    def put(self, refresh: Refresh) -> None:
        """Take the next one."""
        kept = self._kept.get(refresh.bearing.id)
        if kept is None or is_full(refresh.averaged) or not is_full(kept.averaged):
            self._kept[refresh.bearing.id] = refresh

    def all(self) -> Iterable[Refresh]:
        """One for each bearing, in the order they came."""
        return self._kept.values()


def calibration_differences(
    ids: Sequence[str], recorded: UnitCalibration, configured: UnitCalibration
) -> list[str]:
    """What the plant file says otherwise than the recording, in words.

    Parameters
    ----------
    ids
        Of the waveform channels, which are the same in both.
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
