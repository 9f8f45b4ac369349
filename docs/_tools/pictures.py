"""List of dashboard pictures: every page, some in the dark theme or on a phone."""

from dataclasses import dataclass

SCREEN = (1280, 800)
PHONE = (360, 780)

UNIT = "#/units/U2"
BEARING = f"{UNIT}/bearings/UJB"


@dataclass(frozen=True)
class Picture:
    """A picture of a page.

    Parameters
    ----------
    until
        Selector of an element that must exist before the picture is taken.
    is_remote
        Whether the request comes from another computer, so that a login is required.
    """

    name: str
    address: str
    until: str
    is_dark: bool = False
    is_phone: bool = False
    is_remote: bool = False


PAGES = (
    Picture("overview", "#/", "[data-unit]"),
    Picture("unit", UNIT, ".film-brief"),
    Picture("bearing", BEARING, "[data-chart=spectrum] path.js-line"),
    Picture("film", f"{BEARING}/film", "[data-chart=baseline-map] .heatmaplayer"),
    Picture("alarms", "#/alarms", "[data-alarm]"),
    Picture("trends", "#/trends?b=U2%2FUJB&b=U1%2FUJB", "path.js-line"),
    Picture("waterfall", f"{BEARING}/waterfall", "[data-chart] svg, [data-chart] canvas"),
    Picture("orbits", f"{BEARING}/orbits", ".orbit-pictures canvas"),
    Picture("sources", "#/sources", "[data-source]"),
    Picture("recordings", "#/recordings", "[data-recording]"),
    Picture("audit", "#/audit", "[data-entry]"),
    Picture("access", "#/access", "[data-key]"),
    Picture("login", "#/", ".door", is_remote=True),
)
"""All pages of a plant with an alarm, a recording, an account and a key."""

TWENTY = Picture("twenty", "#/", "[data-unit=U20]")
"""Picture of the plant with twenty units."""


def every_look(picture: Picture) -> list[Picture]:
    """Return a page in the light and the dark theme, on a screen and on a phone."""
    return [
        Picture(
            f"{picture.name}{'-phone' * is_phone}{'-dark' * is_dark}",
            picture.address,
            picture.until,
            is_dark=is_dark,
            is_phone=is_phone,
            is_remote=picture.is_remote,
        )
        for is_phone in (False, True)
        for is_dark in (False, True)
    ]


IN_THE_GUIDE = frozenset(["unit-phone", *(picture.name for picture in (*PAGES, TWENTY))])
"""Pictures in the documentation; the others are for development of the dashboard."""
