"""What tests of several pages ask of a page."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.async_api import Locator, Page, Route, expect
from real_plant import PASSWORD

from service.dashboard.assets import edition

FILES = f"/static/{edition()}/"
"""Where the modules of the dashboard are."""

A_NUMBER = re.compile(r"\d")
CHARTS = ("stiffness-trend", "amplitude-trend", "orbit", "centre", "spectrum")
"""Of the page of a bearing."""

SECOND_SPECTRUM = "() => Number(document.querySelector('#moment')?.max) > 0"
HAS_ORBIT = """() => {
  const canvas = document.querySelector("canvas.orbit-canvas");
  const dots = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return dots.some((value) => value > 0);
}"""

NO_NUMBER = """() => [...document.querySelectorAll('.number')].every(n => n.textContent === '—')
    && [...document.querySelectorAll('.spread')].every(n => n.hidden)"""

AGE = """() => {
    const words = document.querySelector('.source .data-age').textContent;
    const [, minutes, seconds] = /Data age (?:(\\d+) min )?(\\d+) s/.exec(words);
    return 60 * Number(minutes ?? 0) + Number(seconds);
}"""

AXE = Path(__file__).parent / "javascript" / "node_modules" / "axe-core" / "axe.min.js"
GRAVE = """async () => {
  const options = { rules: { "target-size": { enabled: true } }, resultTypes: ["violations"] };
  const { violations } = await axe.run(document, options);
  const grave = violations.filter(({ impact }) => ["serious", "critical"].includes(impact));
  return grave.map(({ id, nodes }) => [id, nodes.map(({ html }) => html)]);
}"""
N_TABS = 180
WIDTHS = "() => [document.documentElement.scrollWidth, window.innerWidth]"


async def log_in(page: Page, name: str, password: str = PASSWORD) -> None:
    await page.get_by_label("Name", exact=True).fill(name)
    await page.get_by_label("Password", exact=True).fill(password)
    await page.keyboard.press("Enter")


async def freeze(page: Page, url: str, is_wanted: Callable[[dict], bool] = bool) -> dict:
    """Let the page receive one real answer of the service, as it is wanted, again and again.

    The bearings in it have all their readings. What a test changes in it is received, too.
    """
    while not is_wanted(overview := await _whole_overview(page, f"{url}api/v1/")):
        await page.wait_for_timeout(500)
    latest = {
        f"{unit['id']}/bearings/{bearing['bearing']}/latest": bearing
        for unit in overview["units"]
        for bearing in unit["bearings"]
    }

    async def give_latest(route: Route) -> None:
        await route.fulfill(json=latest[route.request.url.partition("/units/")[2]])

    await page.route("**/api/v1/overview*", lambda route: route.fulfill(json=overview))
    await page.route("**/latest", give_latest)
    return overview


async def _whole_overview(page: Page, api: str) -> dict:
    overview: dict = await (await page.request.get(f"{api}overview")).json()
    for unit in overview["units"]:
        for bearing in unit["bearings"]:
            path = f"units/{unit['id']}/bearings/{bearing['bearing']}/latest"
            bearing |= await (await page.request.get(api + path)).json()
    return overview


async def number_with(reading: Locator, unit: str) -> float:
    """The number of a reading once it is there, and not only the unit that it will have."""
    number = reading.locator(".number")
    await expect(reading.locator(".suffix")).to_have_text(unit)
    await expect(number).to_have_text(A_NUMBER)
    return float(await number.inner_text())


async def await_charts(page: Page) -> None:
    for name in CHARTS:
        curve = page.locator(f"[data-chart={name}] .chart path.js-line").first
        await expect(curve).to_be_attached()


async def await_spectra(page: Page) -> None:
    chart = page.locator("[data-chart=waterfall] .chart")
    await expect(chart.locator(".heatmaplayer image").first).to_be_attached()
    await page.wait_for_function(SECOND_SPECTRUM)


async def await_orbit(page: Page) -> None:
    await expect(page.locator("canvas.orbit-canvas")).to_be_visible()
    await page.wait_for_function(HAS_ORBIT)


async def await_older(page: Page, by_s: int) -> None:
    """Wait until the data of the page's first source are older than they are now."""
    before_s = await page.evaluate(AGE)
    await page.wait_for_function(f"limit => ({AGE})() > limit", arg=before_s + by_s)


async def assert_fits(page: Page) -> None:
    """Nobody has to scroll sideways."""
    width, visible = await page.evaluate(WIDTHS)
    assert width <= visible, f"{page.url} is {width} px wide and {visible} px are seen"


async def assert_accessible(page: Page) -> None:
    """Axe-core has nothing serious or critical to say, in the look that the page has now."""
    if not AXE.is_file():
        pytest.skip("needs npm")
    await page.evaluate(AXE.read_text())
    grave = await page.evaluate(GRAVE)
    assert not grave, f"{page.url}: {grave}"


async def tab_to(page: Page, has_focus: str, wanted: str) -> None:
    """Press the tab key until a condition in JavaScript holds for what is wanted."""
    for _ in range(N_TABS):
        await page.keyboard.press("Tab")
        if await page.evaluate(has_focus, wanted):
            return
    pytest.fail(f"the tab key never reaches {wanted}")
