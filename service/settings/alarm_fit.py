"""Whether a unit measures what its alarms look at."""

from collections.abc import Iterable, Sequence

from core.alarms.alarm import PLANT
from service.settings.base import MisfitError
from service.settings.bearings import BearingSettings
from service.settings.channels import ChannelSettings, Transducer
from service.settings.modbus_sources import ModbusVectorSettings
from service.settings.sources import SourceSettings

FROM_WAVEFORMS = ("shaft_overall_um_pp", "bearing_overall_mm_s_rms")
"""Limits of what a rack that gives amplitudes does not give."""

ZONES = ("shaft_um_pp", "shaft_max_um_pk", "bearing_mm_s_rms")


def require_alarm_fit(
    unit: str,
    source: SourceSettings,
    key_phase: str | None,
    channels: Iterable[ChannelSettings],
    bearings: Sequence[BearingSettings],
) -> None:
    """Refuse limits of what is not measured.

    Raises
    ------
    MisfitError
        With the place of the first.
    """
    if unit == PLANT:
        raise MisfitError("is kept for alarms of the whole plant; choose another", "id")
    is_rack = isinstance(source, ModbusVectorSettings)
    probes = {c.id for c in channels if c.transducer is Transducer.PROXIMITY_PROBE}
    for number, bearing in enumerate(bearings):
        at = ("bearing", number, "alarms")
        if is_rack:
            _require_no_waveforms(bearing, at)
        else:
            _require_gaps(bearing, probes, at)
            _require_phase(bearing, key_phase, at)


def _require_no_waveforms(bearing: BearingSettings, at: tuple[str | int, ...]) -> None:
    words = 'needs waveforms, which a source of kind "modbus_vector" does not give'
    for key in FROM_WAVEFORMS:
        if getattr(bearing.alarms, key) is not None:
            raise MisfitError(words, *at, key)
    for key in ZONES:
        if getattr(bearing.alarms.zones, key) is not None:
            raise MisfitError(words, *at, "zones", key)


def _require_gaps(bearing: BearingSettings, probes: set[str], at: tuple[str | int, ...]) -> None:
    in_x = bearing.gap_x is not None or bearing.shaft_x in probes
    in_y = bearing.gap_y is not None or bearing.shaft_y in probes
    if bearing.alarms.gap_um is not None and not (in_x or in_y):
        raise MisfitError("needs a proximity probe or a slow channel gap_x or gap_y", *at, "gap_um")
    if bearing.alarms.eccentricity_ratio is not None and not (in_x and in_y):
        words = "needs the gaps in x and in y: proximity probes, or slow channels gap_x and gap_y"
        raise MisfitError(words, *at, "eccentricity_ratio")


def _require_phase(
    bearing: BearingSettings, key_phase: str | None, at: tuple[str | int, ...]
) -> None:
    for number, reference in enumerate(bearing.alarms.order1_reference):
        for place, vector in reference.vectors().items():
            if len(vector) == 2 and key_phase is None:
                words = "phase needs the unit's key_phase; without it give the amplitude alone"
                raise MisfitError(words, *at, "order1_reference", number, place)
