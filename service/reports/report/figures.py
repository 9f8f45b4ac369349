"""The plots of a report, each with a sentence, in rows."""

from collections.abc import Iterator

from service.reports.report.case import Case
from service.reports.report.film_figures import condition_figure, map_figure
from service.reports.report.signal_figures import orbit_figure, spectra_figure
from service.reports.report.trend_figure import trend_figure


def figures(case: Case) -> Iterator[str]:
    """All that there is something to show of, in rows."""
    for row in (
        (trend_figure,),
        (condition_figure, map_figure),
        (spectra_figure, orbit_figure),
    ):
        drawn = [figure.html for make in row if (figure := make(case)) is not None]
        if drawn:
            yield f'<div class="row">{"".join(drawn)}</div>'
