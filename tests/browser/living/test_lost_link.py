"""A DAQ that falls silent: the last numbers do not pass for present ones until it answers again."""

from on_screen import A_NUMBER, NO_NUMBER, await_older, await_orbit
from playwright.async_api import expect

BEARING = "#/units/U1/bearings/LJB"
STIFFNESS = "[data-reading=stiffness_xx_n_per_m] .number"
ROW = "[data-alarm='U1:link:link_lost']"


async def test_a_silent_daq_takes_every_number_away_and_is_an_alarm_until_it_answers(plant, page):
    motion = await page.context.new_page()
    await motion.goto(f"{plant.url}{BEARING}/orbits")
    await await_orbit(motion)
    await page.goto(plant.url)
    await expect(page.locator(STIFFNESS).first).to_have_text(A_NUMBER)
    with plant.silent_daq():
        link = page.locator("[data-unit=U1] .unit-head [data-look=bad]")
        await expect(link).to_contain_text("Not connected")
        for quality in await page.locator(".quality .mark").all():
            await expect(quality).to_have_text("Bad: not connected")
        assert await page.evaluate(NO_NUMBER)
        await expect(page.locator(".quality .data-age").first).to_contain_text("old")

        await page.goto(plant.url + BEARING)
        head = page.locator(".bearing-head .state .mark")
        await expect(head).to_have_text("Bad: not connected")
        await await_older(page, 2)
        assert await page.evaluate(NO_NUMBER)
        for name in ("orbit", "spectrum", "stiffness-trend"):
            caption = page.locator(f"[data-chart={name}] figcaption")
            await expect(caption).to_contain_text("Not current: not connected.")
        sentence = motion.locator(".player .sentence")
        await expect(sentence).to_contain_text("not the present")
        await expect(motion.locator("canvas.orbit-canvas")).to_be_visible()
        await page.goto(plant.url + "#/alarms")
        row = page.locator(ROW)
        await expect(row).to_have_attribute("data-state", "unacknowledged")

    await expect(row).to_have_attribute("data-state", "returned_unacknowledged")
    await row.get_by_role("button", name="Acknowledge").click()
    await row.get_by_role("textbox", name="Your name").fill("A. Name")
    await page.keyboard.press("Enter")
    await expect(row).to_have_count(0)
    history = page.get_by_role("table", name="History")
    await expect(history.get_by_role("cell", name="returned", exact=True).first).to_be_visible()
    await page.goto(plant.url + BEARING)
    await expect(page.locator(STIFFNESS)).to_have_text(A_NUMBER)
