"""What a page says is what the API says, to the last digit shown; nothing else passes for it."""

import json

from on_screen import A_NUMBER, DATA_MS
from playwright.async_api import Page, Route, expect

BEARING = "#/units/U1/bearings/UJB"
N_NUMBERS = 57
"""Two preferred, seven of operation and gaps, four of the shaft centre, 13 for each of two orders
(amplitudes, coherence, frequency, equation (5), transfer), four phases, five broad-band, and
dynamic's 13 less two by axis."""

WORDS = {
    "dynamic": "dynamic",
    "transfer_order1": "transfer at 1×",
    "transfer_vortex": "transfer at vortex",
    "ratio_order1": "equation (5) at 1×",
    "ratio_vortex": "equation (5) at vortex",
}

DECIMALS = {
    "_n_per_m": (1e9, 3),
    "_n_s_per_m": (1e6, 2),
    "_um_pk": (1, 2),
    "_um_pp": (1, 2),
    "_mm_s_rms": (1, 2),
    "_um": (1, 2),
    "_rpm": (1, 2),
    "_mw": (1, 1),
    "_c": (1, 1),
    "_deg": (1, 1),
    "_hz": (1, 4),
    "_ratio": (1, 3),
    "_xx": (1, 3),
    "_yy": (1, 3),
    "coherence_x": (1, 3),
    "coherence_y": (1, 3),
    "_lack_of_fit_x": (1, 2),
    "_lack_of_fit_y": (1, 2),
    "_n_lines": (1, 0),
    "_roundness": (1, 2),
}


def shown(name: str, value: float | None) -> str:
    if value is None:
        return "—"
    scale, decimals = next(form for ending, form in DECIMALS.items() if name.endswith(ending))
    text = f"{value / scale:.{decimals}f}"
    # what is zero in all digits shown has no sign
    return text.replace("-", "" if float(text) == 0.0 else "−")


async def freeze(page: Page, url: str) -> dict:
    """Let the page hear one real answer of the service again and again."""
    answer = await page.request.get(f"{url}api/v1/overview")
    body = await answer.body()

    async def replay(route: Route) -> None:
        await route.fulfill(body=body, content_type="application/json")

    await page.route("**/api/v1/overview", replay)
    return json.loads(body)


async def numbers_in(page: Page, selector: str) -> dict[str, str]:
    return await page.eval_on_selector_all(
        f"{selector} [data-reading]",
        "nodes => Object.fromEntries(nodes.map("
        "node => [node.dataset.reading, node.querySelector('.number').textContent]))",
    )


async def spreads_in(page: Page, selector: str) -> dict[str, str]:
    """Everything that stands behind a ± and can be seen."""
    return await page.eval_on_selector_all(
        f"{selector} [data-reading]:has(.spread:not([hidden]))",
        "nodes => Object.fromEntries(nodes.map("
        "node => [node.dataset.reading, node.querySelector('.spread').textContent]))",
    )


def spread(name: str, reading: dict) -> str:
    value, uncertainty = reading["value"], reading["uncertainty"]
    half = max(uncertainty["high_95"] - value, value - uncertainty["low_95"])
    return f"± {shown(name, half)}"


async def await_stiffness(page: Page) -> None:
    for name in ("stiffness_xx_n_per_m", "order1_k_eff_xx_n_per_m"):
        number = page.locator(f"[data-reading={name}] .number").first
        await expect(number).to_have_text(A_NUMBER, timeout=DATA_MS)


async def test_every_number_of_a_bearing_equals_the_api_to_the_last_digit(
    running_plant, page, picture_of
) -> None:
    await page.goto(running_plant.url + BEARING)
    await await_stiffness(page)
    overview = await freeze(page, running_plant.url)
    await page.reload()
    readings = overview["units"][0]["bearings"][0]["readings"]
    assert readings["order1_k_eff_xx_n_per_m"]["value"] is not None
    stiffness = page.locator("[data-reading=order1_k_eff_xx_n_per_m] .number")
    value = readings["order1_k_eff_xx_n_per_m"]["value"]
    await expect(stiffness).to_have_text(shown("order1_k_eff_xx_n_per_m", value))
    numbers = await numbers_in(page, ".bearing")
    assert numbers == {name: shown(name, readings[name]["value"]) for name in numbers}
    assert len(numbers) >= N_NUMBERS
    await picture_of(page, "bearing")


async def test_the_preferred_stiffness_states_its_interval_and_its_estimator(
    running_plant, page
) -> None:
    await page.goto(running_plant.url + BEARING)
    await await_stiffness(page)
    overview = await freeze(page, running_plant.url)
    latest = overview["units"][0]["bearings"][0]
    await page.reload()
    for axes in ("xx", "yy"):
        name = f"stiffness_{axes}_n_per_m"
        reading = latest["readings"][name]
        tile = page.locator(f".preferred-axis:has([data-reading={name}])")
        await expect(tile.locator(".number")).to_have_text(shown(name, reading["value"]))
        low, high = (shown(name, reading["uncertainty"][end]) for end in ("low_95", "high_95"))
        await expect(tile.locator(".interval")).to_have_text(f"95 %: {low} to {high},")
        await expect(tile.locator(".estimator")).to_have_text(WORDS[latest["estimators"][axes]])
    spreads = await spreads_in(page, ".bearing")
    known = {name: r for name, r in latest["readings"].items() if r["uncertainty"]}
    assert spreads == {name: spread(name, known[name]) for name in spreads}
    assert {"stiffness_xx_n_per_m", "order1_k_eff_yy_n_per_m"} <= spreads.keys()


async def test_the_overview_shows_the_numbers_of_every_bearing(
    running_plant, page, picture_of
) -> None:
    await page.goto(running_plant.url)
    await await_stiffness(page)
    overview = await freeze(page, running_plant.url)
    await page.reload()
    for latest in overview["units"][0]["bearings"]:
        row = f"[data-unit=U1] [data-bearing={latest['bearing']}]"
        stiffness = latest["readings"]["order1_k_eff_yy_n_per_m"]["value"]
        number = page.locator(f"{row} [data-reading=order1_k_eff_yy_n_per_m] .number")
        await expect(number).to_have_text(shown("order1_k_eff_yy_n_per_m", stiffness))
        for name, text in (await numbers_in(page, row)).items():
            assert text == shown(name, latest["readings"][name]["value"]), name
        preferred = [f"stiffness_{axes}_n_per_m" for axes in ("xx", "yy")]
        assert await spreads_in(page, row) == {
            name: spread(name, latest["readings"][name]) for name in preferred
        }
        named = [WORDS[name] for name in latest["estimators"].values()]
        origin = named[0] if len(set(named)) == 1 else f"xx {named[0]}, yy {named[1]}"
        await expect(page.locator(f"{row} .preferred .from")).to_have_text(origin)
    await picture_of(page, "overview")


async def test_a_number_without_value_says_why_instead_of_zero(running_plant, page) -> None:
    await page.goto(running_plant.url)
    await await_stiffness(page)
    overview = await freeze(page, running_plant.url)
    reading = overview["units"][0]["bearings"][0]["readings"]["vortex_k_eff_xx_n_per_m"]
    reading |= {"value": None, "level": "bad", "reason": "insufficient_excitation"}

    async def replay(route: Route) -> None:
        await route.fulfill(json=overview)

    await page.route("**/api/v1/overview", replay)
    cell = page.locator("[data-bearing=UJB] [data-reading=vortex_k_eff_xx_n_per_m]")
    await expect(cell.locator(".number")).to_have_text("—")
    await expect(cell.locator(".why")).to_have_text("not enough excitation")
