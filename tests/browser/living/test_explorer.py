"""The trend explorer: comparing, zooming, and what it says where there is nothing."""

import csv
import re
from datetime import UTC, datetime, timedelta
from urllib.parse import parse_qs, urlsplit

import pytest
from on_screen import FILES, freeze
from playwright.async_api import Page, Request, expect

STIFFNESS = "[data-chart=trend-film-stiffness-gn-m]"
COMPARED = "#/trends?b=U1/UJB&b=U1/LJB&q=stiffness_xx_n_per_m"
CALL = (
    f"async ([module, name, ...given]) => (await import(`{FILES}${{module}}.js`))[name](...given)"
)
CURVES = ".chart .scatterlayer .trace path.js-line"


async def await_curve(page: Page, name: str = STIFFNESS) -> None:
    await expect(page.locator(f"{name} {CURVES}").first).to_be_attached()


def days(request: Request) -> float:
    """How long a time of trends is asked for; 0 if it is something else."""
    parts = urlsplit(request.url)
    if not parts.path.endswith("/trends"):
        return 0.0
    query = parse_qs(parts.query)
    start, end = (datetime.fromisoformat(query[name][0]) for name in ("start", "end"))
    return (end - start) / timedelta(days=1)


@pytest.mark.long
async def test_two_bearings_are_compared_and_the_address_says_so(plant, page, complaints):
    await page.goto(plant.url + "#/trends")
    await expect(page.locator("#main summary").first).to_have_text("Bearings: 1")

    await page.locator("#main summary").first.click()
    await page.get_by_role("checkbox", name="U1 LJB").check()
    await page.get_by_role("radio", name="Month").check()

    legend = page.locator(f"{STIFFNESS} .legendtext")
    await expect(legend.filter(has_text="U1 UJB: xx")).to_have_count(1)
    await expect(legend.filter(has_text="U1 LJB: xx")).to_have_count(1)
    assert "b=U1%2FUJB&b=U1%2FLJB" in await page.evaluate("location.hash")
    assert "last=2592000" in await page.evaluate("location.hash")
    assert complaints == []


@pytest.mark.long
async def test_quantities_are_found_by_words_and_taken_away(plant, page):
    await page.goto(plant.url + COMPARED + "&last=2592000")
    await await_curve(page)

    await page.locator("summary", has_text="Quantities").click()
    await page.get_by_role("searchbox", name="Find in quantities").fill("oil temp")
    boxes = page.get_by_role("group", name="Operation").get_by_role("checkbox")
    await expect(boxes).to_have_count(1)
    await boxes.check()

    await await_curve(page, "[data-chart=trend-operation-c]")
    heading = page.locator("[data-chart=trend-operation-c] h2")
    await expect(heading).to_have_text("U1 UJB, U1 LJB: Oil temperature, °C")
    assert "q=oil_temperature_c" in await page.evaluate("location.hash")

    async with page.expect_download() as started:
        await page.get_by_role("link", name="U1 LJB as CSV").click()
    path = await (await started.value).path()
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert len(rows) > 100
    assert "stiffness_xx_n_per_m_mean [N/m]" in rows[0]


@pytest.mark.long
async def test_the_mouse_and_the_keyboard_zoom_and_back_leads_back(plant, page):
    await page.goto(plant.url + COMPARED + "&last=2592000")
    await await_curve(page)
    before = page.url

    area = page.locator(f"{STIFFNESS} .nsewdrag")
    box = await area.bounding_box()
    assert box is not None
    across = [box["x"] + share * box["width"] for share in (0.4, 0.6)]
    await page.mouse.move(across[0], box["y"] + box["height"] / 2)
    await page.mouse.down()
    await page.mouse.move(across[1], box["y"] + box["height"] / 2, steps=8)
    async with page.expect_request(lambda request: 0.0 < days(request) < 29.0) as zoomed:
        await page.mouse.up()

    assert days(await zoomed.value) == pytest.approx(6.0, rel=0.1)
    await expect(page).to_have_url(re.compile("from=.*to="))
    await page.get_by_role("button", name="Back").click()
    await expect(page).to_have_url(before)
    await expect(page.get_by_role("radio", name="Month")).to_be_checked()
    await expect(page.get_by_role("button", name="Back")).to_be_disabled()

    for words in ("Zoom in", "Earlier"):
        await page.get_by_role("button", name=words).focus()
        await page.keyboard.press("Enter")

    query = parse_qs((await page.evaluate("location.hash")).partition("?")[2])
    start, end = (datetime.fromisoformat(query[name][0]) for name in ("from", "to"))
    assert end - start == pytest.approx(timedelta(days=15), abs=timedelta(seconds=1))
    assert datetime.now(UTC) - end > timedelta(days=12)


async def test_a_chart_shows_what_is_expected_the_limits_and_notes(plant, page):
    await page.goto(plant.url + "#/trends")
    legend = page.locator(f"{STIFFNESS} .legendtext")
    for name in ("expected", "alert limit", "danger limit"):
        await expect(legend.filter(has_text=name)).to_have_count(1)
    heading = page.locator(f"{STIFFNESS} h2")
    await expect(heading).to_have_text("U1 UJB: Film stiffness, GN/m")
    zone = page.locator(f"{STIFFNESS} .xtitle")
    await expect(zone).to_have_text(re.compile(r"^Local time, UTC"))

    await page.get_by_label("Note", exact=True).fill("shims changed")
    await page.get_by_label("Your name").fill("A. Name")
    await page.get_by_role("button", name="Add note").click()

    await expect(page.locator(".notes li").first).to_contain_text("U1 UJB: shims changed (A. Name)")
    await page.get_by_role("radio", name="Week").check()  # the note is of this very minute
    await expect(legend.filter(has_text="note")).to_have_count(1)
    await page.goto(plant.url + "#/audit")
    await expect(page.get_by_text("shims changed").first).to_be_visible()


async def test_two_units_share_a_chart_and_stiffness_is_drawn_over_eccentricity(plant, page):
    await page.goto(plant.url + COMPARED + "&q=oil_temperature_c&last=2592000")
    await await_curve(page, "[data-chart=trend-operation-c]")

    await page.get_by_role("radio", name="Time, two axes").check()

    await expect(page.locator(f"{STIFFNESS} .y3title")).to_have_text("°C")
    await expect(page.locator("[data-chart=trend-operation-c]")).to_have_count(0)
    legend = page.locator(f"{STIFFNESS} .legendtext")
    await expect(legend.filter(has_text="U1 LJB: Oil temperature")).to_have_count(1)

    over = page.get_by_role("group", name="Over")
    await over.get_by_role("radio", name="Eccentricity").check()

    await expect(page.locator(f"{STIFFNESS} .xtitle")).to_have_text("Eccentricity ratio")
    points = page.locator(f"{STIFFNESS} .points path.point")
    await expect(points.nth(20)).to_be_attached()
    assert "over=eccentricity_ratio" in await page.evaluate("location.hash")
    await page.reload()
    await expect(over.get_by_role("radio", name="Eccentricity")).to_be_checked()


async def test_a_time_without_results_says_so(plant, page):
    empty = "&from=2001-01-01T00:00:00Z&to=2001-01-02T00:00:00Z"
    await page.goto(plant.url + COMPARED + empty)
    sentence = page.locator(f"{STIFFNESS} .sentence")
    await expect(sentence).to_contain_text("Nothing was stored from 2001-01-01")

    await page.get_by_label("While at").select_option("standstill")
    await expect(sentence).to_contain_text("at standstill")
    await page.locator("#main summary").first.click()
    for bearing in ("U1 UJB", "U1 LJB"):
        await page.get_by_role("checkbox", name=bearing).uncheck()
    none = page.get_by_text("Choose at least one bearing.")
    await expect(none).to_be_visible()


async def test_an_address_restores_what_was_shown_and_is_complained_of_in_words(plant, page):
    address = "#/trends?b=U1/TJB&q=speed_rpm&q=power_mw&last=604800&state=full_load"
    await page.goto(plant.url + address)

    await expect(page.locator("[data-chart=trend-operation-r-min]")).to_be_visible()
    await expect(page.locator("[data-chart=trend-operation-mw]")).to_be_visible()
    await expect(page.get_by_role("radio", name="Week")).to_be_checked()
    await expect(page.get_by_label("While at")).to_have_value("full_load")
    await expect(page.locator("#main summary").first).to_have_text("Bearings: 1")

    address = "#/trends?b=U1/UJB&b=U9/XYZ&q=stiffness_xx_n_per_m&q=warp_factor&last=2592000"
    await page.goto(plant.url + address)
    await await_curve(page)
    await expect(page.get_by_text("This padwatch knows no quantity warp_factor.")).to_be_visible()
    await expect(page.get_by_text("U9 XYZ:")).to_be_visible()


async def test_the_page_of_a_bearing_leads_to_its_trends(plant, page):
    await page.goto(plant.url + "#/units/U1/bearings/LJB")
    await page.get_by_role("link", name="Compare in Trends").click()
    await expect(page.get_by_role("radio", name="15 min")).to_be_checked()
    await page.go_back()
    await page.get_by_role("radio", name="1 y").check()
    await page.get_by_role("link", name="Compare in Trends").click()

    await await_curve(page)
    await expect(page.get_by_role("radio", name="Year")).to_be_checked()
    await expect(page.locator("#main summary").first).to_have_text("Bearings: 1")
    assert "b=U1%2FLJB" in await page.evaluate("location.hash")
    assert "order1_shaft_x_um_pk" in await page.evaluate("location.hash")


def bucket(value: float, level: str) -> dict[str, object]:
    return {"mean": value, "minimum": value, "maximum": value, "level": level}


async def test_uncertain_values_far_from_the_good_ones_do_not_set_the_axis(plant, page):
    await page.goto(plant.url)
    good = [bucket(0.50, "good"), bucket(0.52, "good")]
    for others, low, high in (
        ([], 0.45, 0.55),
        ([bucket(26.4, "uncertain")], 0.45, 0.55),
        ([bucket(0.60, "uncertain"), bucket(-3.0, "bad")], 0.45, 0.65),
    ):
        axis = await page.evaluate(CALL, ["charts/trend", "valueRange", [[[*good, *others]]]])
        assert low < axis[0] < 0.5
        assert max(0.52, high - 0.05) < axis[1] < high
        n = await page.evaluate(CALL, ["charts/trend", "nOutside", [[[*good, *others]]], axis])
        assert n == sum(one["mean"] in (26.4, -3.0) for one in others)
    alone = [[[bucket(26.4, "uncertain"), bucket(0.5, "bad")]]]
    axis = await page.evaluate(CALL, ["charts/trend", "valueRange", alone])
    assert axis[0] < 0.5
    assert axis[1] > 26.4


@pytest.mark.long
async def test_alarms_are_marked_when_they_were_raised_rose_and_returned(plant, page):
    await page.goto(plant.url)
    events = [
        {
            "kind": "oil_temperature",
            "change": change,
            "level": level,
            "time": f"2026-01-01T0{n}:00Z",
        }
        for n, (change, level) in enumerate(
            [
                *(("raised", "alert"), ("acknowledged", "alert"), ("escalated", "danger")),
                *(("eased", "alert"), ("returned", "alert"), ("commented", None)),
            ]
        )
    ]
    beside = {"events": events, "notes": []}
    marks = await page.evaluate(CALL, ["charts/beside", "markTraces", beside])
    assert [(one["name"], len(one["x"])) for one in marks] == [
        *(("alert", 2), ("danger", 1), ("alarm returned", 1)),
    ]
    assert marks[1]["text"] == ["Oil temperature rose to danger"]


async def test_the_bearing_whose_film_is_in_alarm_comes_first(plant, page):
    overview = await freeze(page, plant.url)
    overview["units"][0]["bearings"][2]["film"]["y"]["level"] = "danger"
    overview["units"][0]["bearings"][1]["film"]["x"]["level"] = "alert"
    await page.goto(plant.url + "#/trends")

    await expect(page.locator(f"{STIFFNESS} h2")).to_contain_text("U1 TJB: ")
    assert "b=U1%2FTJB" in await page.evaluate("location.hash")
    await page.goto(plant.url + "#/trends?b=U1%2FUJB")
    await expect(page.locator(f"{STIFFNESS} h2")).to_contain_text("U1 UJB: ")
