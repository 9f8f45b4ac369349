"""The alarm list without a mouse; receivers that are away; answers that hold nothing new."""

import asyncio

from on_screen import tab_to
from playwright.async_api import Page, Response, Route, expect

LIST = "#/alarms"
LINK = "[data-alarm='U1:link:link_lost']"

SAYS = """
wanted =>
  (document.activeElement.ariaLabel || document.activeElement.textContent).trim() === wanted
"""
IN_MAIN = "document.getElementById('main').contains(document.activeElement)"
OUTLINE = "parseFloat(getComputedStyle(document.activeElement).outlineWidth)"


async def tab_in_sight(page: Page, wanted: str) -> None:
    await tab_to(page, SAYS, wanted)
    assert await page.evaluate(OUTLINE) > 0, f"nobody sees that {wanted} has the focus"


async def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    await reader.readuntil(b"\r\n\r\n")
    writer.write(b"HTTP/1.1 204 No Content\r\n\r\n")
    writer.close()


def is_nothing_new(response: Response) -> bool:
    return response.url.endswith("/api/v1/alarms") and response.status == 304


async def test_an_alarm_is_acknowledged_shelved_and_brought_back_by_keys_alone(
    plant, page, complaints
) -> None:
    await page.goto(plant.url + LIST)
    row = page.locator(LINK)
    await expect(row).to_be_visible()
    await expect(row).to_contain_text("Link lost")
    await expect(row.locator(".mark")).to_have_text("Alert")
    head = page.locator("#alarms .mark")
    await expect(head).to_contain_text("1 alarm, 1 not acknowledged")
    await expect(head).to_have_attribute("data-look", "alert")
    await expect(page.locator(".unjudged summary")).to_contain_text("cannot be judged now")
    await page.keyboard.press("Tab")
    await expect(page.get_by_text("Skip to the numbers")).to_be_focused()
    await page.keyboard.press("Enter")
    await page.keyboard.press("Tab")
    assert await page.evaluate(IN_MAIN)

    await row.get_by_role("button", name="Acknowledge").press("Enter")
    await expect(row.get_by_role("alert")).to_have_text("Give your name first.")
    await page.get_by_label("Your name").focus()
    await page.keyboard.type("A. Name")
    done = page.locator(".done")
    await tab_in_sight(page, "Acknowledge")
    await page.keyboard.press("Enter")
    await expect(row).to_have_attribute("data-state", "acknowledged")
    await expect(done).to_have_text("U1, Link lost: acknowledged.")
    await expect(row.get_by_role("button", name="Acknowledge")).to_be_hidden()
    await expect(row.get_by_role("button", name="Shelve…")).to_be_focused()
    await expect(head).to_contain_text("1 alarm, 16 not judged")

    await page.keyboard.press("Enter")
    await expect(page.get_by_label("Why it is shelved")).to_be_focused()
    await page.keyboard.press("Escape")
    await expect(row.get_by_role("button", name="Shelve…")).to_be_focused()
    await page.keyboard.press("Enter")
    await page.keyboard.type("the DAQ is being changed")
    await page.keyboard.press("Enter")
    shelved = page.get_by_role("table", name="Taken off the list").locator(LINK)
    await expect(shelved).to_contain_text("Shelved by A. Name until")
    await expect(shelved).to_contain_text("the DAQ is being changed")
    await expect(done).to_have_text("U1, Link lost: shelved.")
    await expect(page.locator("h1")).to_be_focused()

    await tab_in_sight(page, "Unshelve")
    await page.keyboard.press("Enter")
    listed = page.get_by_role("table", name="On the list").locator(LINK)
    await expect(listed).to_have_attribute("data-state", "unacknowledged")
    await expect(page.locator("h1")).to_be_focused()
    history = page.get_by_role("table", name="History")
    for words in ("raised", "acknowledged", "shelved", "back from the shelf"):
        await expect(history.get_by_role("cell", name=words, exact=True).first).to_be_visible()
    asking = page.get_by_role("search", name="History")
    await asking.get_by_label("Raised at").select_option("full load")
    await asking.get_by_role("button", name="Look").click()
    await expect(history).to_be_hidden()
    await expect(page.get_by_text("Nothing was raised under that condition.")).to_be_visible()
    await asking.get_by_role("button", name="Clear").click()
    await expect(history).to_be_visible()
    assert complaints == []


async def test_a_receiver_that_is_away_is_named_until_it_has_taken_what_waits(
    plant, page, receiver_port
) -> None:
    await page.goto(plant.url + LIST)
    line = page.locator(".delivery li")
    await expect(line).to_contain_text("desk: not delivered since")
    await expect(line).to_contain_text("since")
    await expect(line.locator(".mark")).to_have_attribute("data-look", "bad")

    async with await asyncio.start_server(take, "127.0.0.1", receiver_port):
        await expect(page.locator(".delivery")).to_be_hidden()


async def test_what_has_not_changed_is_not_sent_again_and_stays_on_the_page(plant, page) -> None:
    async with page.expect_response(is_nothing_new):
        await page.goto(plant.url + LIST)
    async with page.expect_response(is_nothing_new):
        await expect(page.locator(LINK)).to_be_visible()
    await expect(page.locator(".alarms-head .mark")).to_be_hidden()
    await expect(page.locator("#service")).to_contain_text("Service answered")


async def test_a_page_from_before_an_upgrade_says_so_and_loads_the_new_one(plant, page) -> None:
    await page.goto(plant.url)
    await expect(page.locator("#service")).to_contain_text("Service answered")
    await expect(page.locator("#upgrade")).to_be_hidden()

    async def of_a_later_service(route: Route) -> None:
        asked = {**route.request.headers, "if-none-match": '"of before"'}
        answer = await route.fetch(headers=asked)
        await route.fulfill(response=answer, headers={**answer.headers, "padwatch-edition": "9"})

    await page.route("**/api/v1/overview*", of_a_later_service)
    await expect(page.get_by_text("has been upgraded")).to_be_visible()
    await page.unroute("**/api/v1/overview*")
    await page.get_by_role("button", name="Reload the page").click()
    await expect(page.locator("#service")).to_contain_text("Service answered")
    await expect(page.locator("#upgrade")).to_be_hidden()
