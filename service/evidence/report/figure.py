"""`Figure`: a plot with its sentence."""

from dataclasses import dataclass
from html import escape


@dataclass(frozen=True)
class Figure:
    """A plot with the sentence that says what it shows."""

    svg: str
    sentence: str

    @property
    def html(self) -> str:
        """Both together."""
        caption = f"<figcaption>{escape(self.sentence)}</figcaption>"
        return f"<figure>{self.svg}{caption}</figure>"
