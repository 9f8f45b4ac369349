"""`Figure`: a plot with its sentence."""

from dataclasses import dataclass
from html import escape

from service.reports.plots.plot import Plot


@dataclass(frozen=True)
class Figure:
    """A plot with the sentence that says what it shows."""

    plot: Plot
    sentence: str

    @property
    def html(self) -> str:
        """Both together, as wide as the plot is beside others, so that all writing is alike."""
        caption = f"<figcaption>{escape(self.sentence)}</figcaption>"
        return f'<figure style="flex:{self.plot.width:g}">{self.plot.svg()}{caption}</figure>'
