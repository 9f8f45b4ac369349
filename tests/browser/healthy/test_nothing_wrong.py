"""What pages show while there is nothing wrong, nothing recorded and nobody let in."""

import re

from playwright.async_api import expect

NOT_WATCHED = "This film is not watched: operating states require power_channel and rated_power_mw."


async def test_pages_without_contents_say_why(plant, page, complaints) -> None:
    await page.goto(plant.url)
    link = page.locator("#alarms")
    await expect(link).to_contain_text("No alarms")
    await link.click()
    await expect(page.locator("h1")).to_have_text("Alarms")
    await expect(page.get_by_text("Nothing is on the list.")).to_be_visible()
    await expect(link).to_have_attribute("aria-current", "page")
    line = page.locator(".alarm-rates")
    await expect(line).to_contain_text("Seven days: ")
    for words in ("a day", "in ten minutes, at most", "chattering", "standing for more than a day"):
        await expect(line).to_contain_text(words)

    await page.goto(plant.url + "#/recordings")
    await expect(page.locator(".recordings")).to_contain_text("None yet. When an alarm is raised")
    await expect(page.locator(".reports")).to_contain_text("None yet: no alarm has been raised.")
    await page.goto(plant.url + "#/access")
    await expect(page.locator(".accounts")).to_contain_text("No account yet")
    await expect(page.locator(".keys")).to_contain_text("No key yet")
    assert complaints == []


async def test_a_source_in_good_health_says_what_arrives_from_where(
    plant, page, complaints
) -> None:
    await page.goto(plant.url + "#/sources")
    row = page.locator("[data-source=U1]")
    await expect(row.locator(".mark").first).to_have_text("Connected")
    await expect(row.locator("[data-head=Missing]")).to_have_text("0")
    await expect(page.get_by_text("1 of 1 connected.")).to_be_visible()
    await row.get_by_role("button", name="Details").focus()
    await page.keyboard.press("Enter")
    facts = page.locator("#source-U1")
    await expect(facts).to_contain_text("Modbus, block ring")
    await expect(facts).to_contain_text("127.0.0.1:")
    await expect(facts).to_contain_text("Not checked: the plant file gives none")
    await expect(row.locator("[data-head=Poll]")).to_contain_text("s")
    [source] = await (await page.request.get(f"{plant.url}api/v1/sources")).json()
    shown = await row.locator("[data-head=Received]").inner_text()
    assert 0 < int(re.sub(r"\D", "", shown)) <= source["n_stored"] + source["n_flagged"]
    await row.get_by_role("link").click()
    await expect(page.locator("h1")).to_contain_text("Unit 1")
    assert complaints == []


async def test_a_film_that_is_not_watched_says_why_in_place_of_every_chart(
    plant, page, complaints
) -> None:
    await page.goto(plant.url + "#/units/U1/bearings/UJB/film")
    await expect(page.locator(".film-verdict .sentence")).to_have_text(NOT_WATCHED)
    for name in ("baseline-map", "against-eccentricity_ratio", "against-oil_temperature_c"):
        await expect(page.locator(f"[data-chart={name}] .sentence")).to_have_text(NOT_WATCHED)
    await page.goto(plant.url)
    await expect(page.locator("[data-bearing=UJB] .film-brief")).to_have_text("Not watched")
    assert complaints == []
