"""Links between pages lead somewhere, also where nothing is built: on a forge, in an editor."""

import re
from pathlib import Path
from urllib.parse import unquote

LINK = re.compile(r"\]\((?!https?:|mailto:|#table-)([^)\s]+)\)")
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^#{1,6} +(.+?) *$", re.MULTILINE)


def text_of(page: Path) -> str:
    return FENCE.sub("", page.read_text(encoding="utf-8"))


def anchors_of(page: Path) -> set[str]:
    """Names of the places on a page, as forges and MyST make them of headings."""
    headings = HEADING.findall(text_of(page))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_links_on_pages_lead_somewhere(page: Path) -> None:
    for link in LINK.findall(text_of(page)):
        path, _, anchor = unquote(link).partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{link} leads nowhere"
        if anchor.startswith("table-"):  # of tables that are made when the documentation is built
            assert target.parent.name == "reference"
        elif anchor:
            assert anchor in anchors_of(target), f"{link}: no such heading; {anchors_of(target)}"


def test_images_have_words_for_those_who_cannot_see_them(page: Path) -> None:
    for words, image in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", text_of(page)):
        assert words, f"{image} has no words"
