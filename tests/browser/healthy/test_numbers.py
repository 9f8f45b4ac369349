"""What a page says is what the API says, to the last digit shown; nothing else passes for it."""

from on_screen import A_NUMBER, freeze
from playwright.async_api import Page, Route, expect

BEARING = "#/units/U1/bearings/UJB"
PREFERRED = "stiffness_xx_n_per_m"
N_NUMBERS = 57
"""Two preferred, seven of operation and gaps, four of the shaft centre, 13 for each of two orders
(amplitudes, coherence, frequency, equation (5), transfer), four phases, five broad-band, and
dynamic's 13 less two by axis."""

WORDS = {
    "dynamic": "broadband estimate",
    "transfer_order1": "transfer at 1×",
    "transfer_vortex": "transfer at vortex",
    "ratio_order1": "equation (5) at 1×",
    "ratio_vortex": "equation (5) at vortex",
}

DECIMALS = {
    ("_n_per_m",): (1e9, 3),
    ("_n_s_per_m",): (1e6, 2),
    ("_lack_of_fit_x", "_lack_of_fit_y", "_mm_s_rms", "_roundness", "_ratio"): (1, 2),
    ("_um_pk", "_um_pp", "_rpm", "_mw", "_c"): (1, 1),
    ("_hz", "_xx", "_yy", "coherence_x", "coherence_y"): (1, 3),
    ("_n_lines", "_um", "_deg"): (1, 0),
}


def is_complete(overview: dict) -> bool:
    """Whether every stiffness has its uncertainty, and the first is dynamic: not so at first."""
    bearings = overview["units"][0]["bearings"]
    readings = [b["readings"][f"stiffness_{ax}_n_per_m"] for b in bearings for ax in ("xx", "yy")]
    is_dynamic = set(bearings[0]["estimators"].values()) == {"dynamic"}
    return is_dynamic and all(reading["uncertainty"] for reading in readings)


def shown(name: str, value: float | None) -> str:
    if value is None:
        return "—"
    scale, decimals = next(form for ends, form in DECIMALS.items() if name.endswith(ends))
    text = f"{value / scale:.{decimals}f}"
    # what is zero in all digits shown has no sign
    return text.replace("-", "" if float(text) == 0.0 else "−")


async def texts_in(page: Page, place: str, of: str) -> dict[str, str]:
    """Texts of one kind that can be seen, by the reading that they belong to."""
    return await page.eval_on_selector_all(
        f"{place} [data-reading]:has({of}:not([hidden]))",
        "(nodes, of) => Object.fromEntries(nodes.map("
        "node => [node.dataset.reading, node.querySelector(of).textContent]))",
        of,
    )


def spread(name: str, reading: dict) -> str:
    value, uncertainty = reading["value"], reading["uncertainty"]
    half = max(uncertainty["high_95"] - value, value - uncertainty["low_95"])
    return f"± {shown(name, half)}"


async def test_every_number_of_a_bearing_equals_the_api_to_the_last_digit(plant, page):
    await page.goto(plant.url + BEARING)
    overview = await freeze(page, plant.url, is_complete)
    await page.reload()
    latest = overview["units"][0]["bearings"][0]
    readings = latest["readings"]
    stiffness = page.locator("[data-reading=order1_k_eff_xx_n_per_m] .number")
    value = readings["order1_k_eff_xx_n_per_m"]["value"]
    assert value is not None
    await expect(stiffness).to_have_text(shown("order1_k_eff_xx_n_per_m", value))
    numbers = await texts_in(page, ".bearing", ".number")
    assert numbers == {name: shown(name, readings[name]["value"]) for name in numbers}
    assert len(numbers) >= N_NUMBERS

    spreads = await texts_in(page, ".bearing", ".spread")
    assert spreads == {name: spread(name, readings[name]) for name in spreads}
    assert {"stiffness_xx_n_per_m", "order1_k_eff_yy_n_per_m"} <= spreads.keys()

    rows = await page.locator(".estimators [data-estimator]").all()
    assert [await row.get_attribute("data-estimator") for row in rows] == list(WORDS)
    await expect(page.locator("[data-estimator=dynamic] th")).to_have_text(
        "broadband estimate preferred"
    )
    for name in ("dynamic_k_xx_n_per_m", "dynamic_c_yy_n_s_per_m", "dynamic_n_lines"):
        number = page.locator(f".film [data-reading={name}] .number")
        await expect(number).to_have_text(A_NUMBER)


async def test_recorded_quantities_and_ratios_to_the_bracket_are_on_the_page(plant, page):
    known = {"level": "good", "reason": "ok", "uncertainty": None}
    added = {"pad_temperature_2_c": 58.34, "head_m": 118.0, "stiffness_xx_of_kb": 0.585}

    async def with_more(route: Route) -> None:
        response = await route.fetch(headers={})
        body = await response.json()
        body["readings"] |= {name: known | {"value": value} for name, value in added.items()}
        await route.fulfill(json=body)

    await page.route("**/bearings/UJB/latest", with_more)
    await page.goto(plant.url + BEARING)
    await page.locator("details.fold summary").click()
    for name, text in (("pad_temperature_2_c", "58.3"), ("head_m", "118.0")):
        await expect(page.locator(f"[data-reading={name}] .number")).to_have_text(text)
    stiffness = page.locator(f".tiles [data-reading={PREFERRED}]")
    await expect(stiffness.locator(".number")).to_have_text("0.585")
    await expect(stiffness.locator(".suffix")).to_have_text("k_b")


async def test_the_overview_shows_the_numbers_of_every_bearing(plant, page):
    await page.goto(plant.url)
    overview = await freeze(page, plant.url, is_complete)
    await page.reload()
    for latest in overview["units"][0]["bearings"]:
        row = f"[data-unit=U1] [data-bearing={latest['bearing']}]"
        stiffness = latest["readings"]["stiffness_yy_n_per_m"]["value"]
        number = page.locator(f"{row} [data-reading=stiffness_yy_n_per_m] .number")
        await expect(number).to_have_text(shown("stiffness_yy_n_per_m", stiffness))
        for name, text in (await texts_in(page, row, ".number")).items():
            assert text == shown(name, latest["readings"][name]["value"]), name


async def test_a_number_without_value_says_why_instead_of_zero(plant, page):
    await page.goto(plant.url)
    overview = await freeze(page, plant.url, is_complete)
    readings = overview["units"][0]["bearings"][0]["readings"]
    for name, reading in readings.items():
        if name == "stiffness_xx_n_per_m" or name.startswith("dynamic_"):
            reading |= {"value": None, "level": "bad", "reason": "insufficient_excitation"}
            reading["uncertainty"] = None
    cell = page.locator("[data-bearing=UJB] [data-reading=stiffness_xx_n_per_m]")
    await expect(cell.locator(".number")).to_have_text("—")
    await expect(cell.locator(".why")).to_have_text("weak signal")

    await page.goto(plant.url + BEARING)
    quality = page.locator("[data-estimator=dynamic] .mark")
    await expect(quality).to_have_text("No value: weak signal")
    for place in ("[data-estimator=dynamic]", ".film"):
        for number in await page.locator(f"{place} [data-reading] .number").all():
            await expect(number).to_have_text("—")
        await expect(page.locator(f"{place} .spread:visible")).to_have_count(0)
