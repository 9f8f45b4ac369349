"""Spectra and orbit of the alarm's bearing."""

import math
from collections.abc import Sequence

from core.quality import Reason
from service.reports.bearing_part import BearingPart
from service.reports.plots.plot import Plot
from service.reports.plots.scales import Scale
from service.reports.report.case import Case
from service.reports.report.figure import Figure
from service.reports.tables import Columns


def spectra_figure(case: Case) -> Figure | None:
    """Spectra of shaft and bearing."""
    bearing, axis = case.bearing, case.direction
    rows = _rows(case.spectra, case.evidence.bearing)
    if bearing is None or len(rows) < 3:
        return None
    f, shaft, frame = (
        [case.spectra[name][i] for i in rows]
        for name in ("frequency_hz", f"shaft_{axis}_um_pk", f"bearing_{axis}_um_pk")
    )
    heights = _decades([*shaft, *frame])
    if heights is None:
        return None
    plot = Plot(
        *(525.0, 146.0),
        *(Scale(0.0, f[-1]), heights),
        *("Frequency, Hz", f"Amplitude {axis}, µm 0-pk", "Spectra", "spectra"),
    )
    _mark_orders(plot, bearing)
    plot.line(f, shaft, "shaft")
    plot.line(f, frame, "bearing")
    return Figure(
        plot,
        f"Averaged spectra in {axis} as displacement, {bearing.window.n_segments} segments in"
        f" {bearing.window.duration_s:.0f} s before the alarm. Blue: shaft relative to bearing."
        " Orange: bearing.",
    )


def _decades(amplitudes: Sequence[float]) -> Scale | None:
    """Whole decades that hold all amplitudes, five at most; None if there is no motion."""
    seen = [value for value in amplitudes if value and value > 0.0]
    if not seen:
        return None
    top = max(seen)
    floor = max(min(seen), top * 1e-5)
    low, high = math.floor(math.log10(floor)), math.ceil(math.log10(top))
    return Scale(10.0**low, 10.0 ** max(high, low + 1), True)


def _mark_orders(plot: Plot, bearing: BearingPart) -> None:
    lines = (("order1_frequency_hz", "1×"), ("vortex_frequency_hz", "vortex"))
    for row, (name, words) in enumerate(lines):
        reading = bearing.readings.get(name)
        is_there = reading is not None and reading.reason != Reason.OUTSIDE_BAND
        if reading is not None and is_there and reading.value is not None:
            plot.upright(reading.value, "marked", words, row)


def orbit_figure(case: Case) -> Figure | None:
    """The newest turns of the shaft."""
    rows = _rows(case.orbits, case.evidence.bearing)
    if len(rows) < 2:
        return None
    x, y = ([case.orbits[name][i] for i in rows] for name in ("shaft_x_um", "shaft_y_um"))
    most = 1.1 * max(abs(value) for value in (*x, *y)) or 1.0
    plot = Plot(
        *(170.0, 146.0),
        Scale(-most, most),
        Scale(-most, most),
        *("Shaft x, µm", "Shaft y, µm", "Orbit", "orbit"),
    )
    plot.line(x, y, "shaft", math.inf)
    return Figure(plot, "The newest turns of the shaft in its bearing, means removed.")


def _rows(table: Columns, bearing: str | None) -> list[int]:
    return [i for i, each in enumerate(table.get("bearing", ())) if each == bearing]
