"""What tests of several pages ask of a page."""

import re

import pytest
from playwright.async_api import Locator, Page, expect

A_NUMBER = re.compile(r"\d")
DATA_MS = 60_000
"""Until a number that has to be measured first is there, on a busy machine."""

N_TABS = 60
WIDTHS = "() => [document.documentElement.scrollWidth, window.innerWidth]"


async def number_with(reading: Locator, unit: str) -> float:
    """The number of a reading once it is there, and not only the unit that it will have."""
    number = reading.locator(".number")
    await expect(reading.locator(".suffix")).to_have_text(unit, timeout=DATA_MS)
    await expect(number).to_have_text(A_NUMBER, timeout=DATA_MS)
    return float(await number.inner_text())


async def assert_fits(page: Page) -> None:
    """Nobody has to scroll sideways."""
    width, visible = await page.evaluate(WIDTHS)
    assert width <= visible, f"{page.url} is {width} px wide and {visible} px are seen"


async def tab_to(page: Page, has_focus: str, wanted: str) -> None:
    """Press the tab key until a condition in JavaScript holds for what is wanted."""
    for _ in range(N_TABS):
        await page.keyboard.press("Tab")
        if await page.evaluate(has_focus, wanted):
            return
    pytest.fail(f"the tab key never reaches {wanted}")
