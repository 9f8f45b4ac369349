"""From the program's values to the API's models."""

from core.monitor.assessment import Assessment, AveragingWindow, OrbitTrace
from core.monitor.catalogue import BY_NAME
from core.quality import Level, Quality, Reading
from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y
from core.stiffness.order_line import marked_hz
from core.uncertainty import Budget
from service.api.budget_models import BudgetLineModel, BudgetModel
from service.api.models import (
    EstimatorName,
    LatestModel,
    LevelName,
    QualityModel,
    ReadingModel,
    RunoutName,
    UncertaintyModel,
    WindowModel,
)
from service.api.plant_models import DeviceClockModel, SourceModel
from service.api.ports import LiveLook
from service.api.series_models import (
    OrbitModel,
    PlaceName,
    SpectrumChannelModel,
    SpectrumModel,
)
from service.live.live_view import CurrentBearing, UnitStatus
from service.runtime.times import rfc3339

LEVEL_NAMES: dict[Level, LevelName] = {
    Level.GOOD: "good",
    Level.UNCERTAIN: "uncertain",
    Level.BAD: "bad",
}

PLACES: dict[PlaceName, int] = {
    "shaft_x": SHAFT_X,
    "shaft_y": SHAFT_Y,
    "bearing_x": BEARING_X,
    "bearing_y": BEARING_Y,
}


def quality_model(quality: Quality) -> QualityModel:
    """Quality by name."""
    return QualityModel(level=LEVEL_NAMES[quality.level], reason=quality.reason.value)


def reading_model(name: str, reading: Reading) -> ReadingModel:
    """A reading with unit and words from the catalogue."""
    quantity = BY_NAME[name]
    return ReadingModel(
        value=reading.value,
        unit=quantity.unit,
        label=quantity.label,
        level=LEVEL_NAMES[reading.quality.level],
        reason=reading.quality.reason.value,
        uncertainty=_uncertainty(reading),
    )


def _uncertainty(reading: Reading) -> UncertaintyModel | None:
    if reading.interval_95 is None:
        return None
    return UncertaintyModel(
        random=reading.u_random,
        systematic=reading.u_systematic,
        low_95=reading.interval_95[0],
        high_95=reading.interval_95[1],
    )


def budget_model(name: str, time_ns: int, budget: Budget) -> BudgetModel:
    """A budget, its largest contribution first."""
    low, high = budget.interval
    ordered = sorted(budget.lines, key=lambda line: line.contribution, reverse=True)
    return BudgetModel(
        quantity=name,
        unit=BY_NAME[name].unit,
        time=rfc3339(time_ns),
        value=budget.value,
        uncertainty=UncertaintyModel(
            random=budget.random, systematic=budget.systematic, low_95=low, high_95=high
        ),
        lines=[
            BudgetLineModel(
                name=line.name,
                kind=line.kind.value,
                distribution=line.distribution.value,
                width=line.width,
                sensitivity=line.sensitivity,
                contribution=line.contribution,
            )
            for line in ordered
        ],
    )


def latest_model(live: LiveLook, unit: str, bearing: str) -> LatestModel:
    """A bearing as it may be shown now."""
    current = live.current(unit, bearing)
    newest = current.assessment
    return LatestModel(
        unit=unit,
        bearing=bearing,
        time=rfc3339(newest.time_ns) if newest else None,
        age_s=current.age_s,
        quality=quality_model(current.quality),
        speed_source=newest.speed_source.value if newest else None,
        window=window_model(newest.window) if newest else None,
        estimators=_estimators(current),
        runout=_runout(current),
        clipped_share=dict(newest.clipped_share) if newest and current.is_current else {},
        readings={name: reading_model(name, r) for name, r in current.readings.items()},
    )


def _estimators(current: CurrentBearing) -> dict[str, EstimatorName | None]:
    if current.assessment is None or not current.is_current:
        return {"xx": None, "yy": None}
    return estimator_names(current.assessment)


def estimator_names(assessment: Assessment) -> dict[str, EstimatorName | None]:
    """Where the preferred stiffness came from, by axes."""
    chosen = assessment.estimators
    return {axes: estimator.value if estimator else None for axes, estimator in chosen.items()}


def _runout(current: CurrentBearing) -> dict[str, RunoutName | None]:
    if current.assessment is None or not current.is_current:
        return {"shaft_x": None, "shaft_y": None}
    return runout_names(current.assessment)


def runout_names(assessment: Assessment) -> dict[str, RunoutName | None]:
    """What was done about runout, by shaft channel."""
    return {place: verdict.value for place, verdict in assessment.runout.items()}


def window_model(window: AveragingWindow) -> WindowModel:
    """The samples of a result."""
    return WindowModel(
        epoch=window.epoch,
        first_index=window.first_index,
        last_index=window.stop_index - 1,
        n_segments=window.n_segments,
        n_segments_wanted=window.n_segments_wanted,
        n_voided=window.n_voided,
        coverage=window.coverage,
        duration_s=window.duration_s,
    )


def source_model(live: LiveLook, unit: str) -> SourceModel:
    """How the samples of a unit arrive."""
    status = live.status(unit)
    account = status.account
    last = status.last_sample_ns
    return SourceModel(
        state=status.state.value,
        reason=status.reason,
        since=None if status.since_ns is None else rfc3339(status.since_ns),
        data_age_s=live.data_age_s(unit),
        last_sample_time=None if last is None else rfc3339(last),
        n_offered=account.n_offered,
        n_stored=account.n_stored,
        n_flagged=account.n_flagged,
        n_gap=account.n_gap,
        n_repeated=account.n_repeated,
        n_restarts=account.n_restarts,
        rejected=dict(account.rejected),
        clock=_clock_model(status),
    )


def _clock_model(status: UnitStatus) -> DeviceClockModel | None:
    if status.clock is None:
        return None
    return DeviceClockModel(
        offset_s=status.clock.offset_s,
        drift_ppm=status.clock.drift_ppm,
        drift_uncertainty_ppm=status.clock.u_drift_ppm,
        n_stamp_faults=status.clock.n_faults,
        stamp_fault=None if status.stamp_fault is None else status.stamp_fault.value,
    )


def spectrum_model(assessment: Assessment) -> SpectrumModel:
    """Amplitude spectra of an assessment."""
    spectrum, readings = assessment.spectrum, assessment.readings
    return SpectrumModel(
        time=rfc3339(assessment.time_ns),
        frequency_hz=spectrum.frequency_hz.tolist(),
        channels={
            name: SpectrumChannelModel(
                unit="um_pk",
                amplitude=spectrum.amplitude_um_pk(place).tolist()
                if spectrum.n_segments[place, place]
                else None,
            )
            for name, place in PLACES.items()
        },
        lines={name: marked_hz(readings, name) for name in ("order1", "vortex")},
    )


def orbit_model(orbit: OrbitTrace) -> OrbitModel:
    """The newest turns of the shaft."""
    return OrbitModel(
        time=rfc3339(orbit.start_ns),
        rate_hz=orbit.rate_hz,
        duration_s=orbit.shaft_x_um.size / orbit.rate_hz,
        shaft_x_um=orbit.shaft_x_um.tolist(),
        shaft_y_um=orbit.shaft_y_um.tolist(),
    )
