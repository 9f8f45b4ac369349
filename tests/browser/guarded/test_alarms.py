"""The alarm list without a mouse; receivers that are away; answers that hold nothing new."""

import asyncio

import pytest
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


async def test_an_alarm_is_acknowledged_shelved_and_unshelved_by_keys(plant, page, complaints):
    await page.goto(plant.url + LIST)
    row = page.locator(LINK)
    await expect(row).to_be_visible()
    await expect(row).to_contain_text("Link lost")
    await expect(row.locator(".mark")).to_have_text("Alert")
    head = page.locator("#alarms .mark")
    await expect(head).to_contain_text("1 alarm, 1 unacknowledged")
    await expect(head).to_have_attribute("data-look", "alert")
    await expect(page.locator(".unjudged summary")).to_contain_text("cannot be evaluated now")
    await page.keyboard.press("Tab")
    await expect(page.get_by_text("Skip navigation")).to_be_focused()
    await page.keyboard.press("Enter")
    await page.keyboard.press("Tab")
    assert await page.evaluate(IN_MAIN)

    await row.get_by_role("button", name="Acknowledge").press("Enter")
    await expect(row.get_by_role("textbox", name="Your name")).to_be_focused()
    await page.keyboard.type("A. Name")
    done = page.locator(".done")
    await page.keyboard.press("Enter")
    await expect(row).to_have_attribute("data-state", "acknowledged")
    await expect(done).to_have_text("U1, Link lost: acknowledged.")
    await expect(row.get_by_role("button", name="Acknowledge")).to_be_hidden()
    await expect(row.get_by_role("button", name="Shelve…")).to_be_focused()
    await expect(row.get_by_role("alert")).to_be_empty()
    await expect(page.locator(".alarms-head .actor")).to_contain_text("You act as A. Name.")
    await expect(head).to_contain_text("1 alarm, 16 alarms not judged")

    await page.keyboard.press("Enter")
    await expect(page.get_by_label("Why it is shelved")).to_be_focused()
    await page.keyboard.press("Escape")
    await expect(row.get_by_role("button", name="Shelve…")).to_be_focused()
    await page.keyboard.press("Enter")
    await page.keyboard.type("the DAQ is being changed")
    await page.keyboard.press("Enter")
    shelved = page.get_by_role("table", name="Shelved and suppressed").locator(LINK)
    await expect(shelved).to_contain_text("Shelved by A. Name until")
    await expect(shelved).to_contain_text("the DAQ is being changed")
    await expect(done).to_have_text("U1, Link lost: shelved.")
    await expect(page.locator("h1")).to_be_focused()

    await tab_in_sight(page, "Unshelve")
    await page.keyboard.press("Enter")
    listed = page.get_by_role("table", name="Active alarms").locator(LINK)
    await expect(listed).to_have_attribute("data-state", "unacknowledged")
    await expect(page.locator("h1")).to_be_focused()
    history = page.get_by_role("table", name="History")
    for words in ("raised", "acknowledged", "shelved", "unshelved"):
        await expect(history.get_by_role("cell", name=words, exact=True).first).to_be_visible()
    assert complaints == []


@pytest.mark.long
async def test_the_list_and_its_history_are_filtered_together(plant, page, complaints):
    await page.goto(plant.url + LIST)
    row, history = page.locator(LINK), page.get_by_role("table", name="History")
    await expect(row).to_be_visible()
    await expect(history).to_be_visible()
    await page.get_by_text("Filter and order").click()
    asking = page.get_by_role("search", name="Alarms and history")
    await asking.get_by_label("Raised at").select_option("full load")
    await asking.get_by_role("button", name="Filter").click()
    await expect(row).to_be_hidden()
    await expect(page.get_by_text("Filtered: only alarms that match are shown")).to_be_visible()
    await expect(history).to_be_hidden()
    await expect(page.get_by_text("No event matches the filter.")).to_be_visible()
    await asking.get_by_role("button", name="Clear").click()
    await expect(history).to_be_visible()
    await asking.get_by_label("Where").fill("U1 link")
    await page.keyboard.press("Enter")
    await expect(row).to_be_visible()
    await expect(page.get_by_text("Filtered: only alarms that match are shown")).to_be_visible()
    assert complaints == []


async def test_an_alarm_is_acknowledged_where_it_is_seen(plant, page, complaints):
    await page.goto(plant.url + LIST)
    await shelve_and_back(page)
    for place, words, is_last in [("#/", "Link", False), ("#/units/U1", "not acknowledged", True)]:
        await page.goto(plant.url + place)
        line = page.locator(f".unit-alarms {LINK}")
        await expect(line).to_contain_text(words)
        if is_last:
            await line.get_by_role("button", name="Acknowledge").press("Enter")
            await expect(line).not_to_contain_text("not acknowledged")
            await expect(line.get_by_role("link", name="U1: Link lost")).to_be_focused()
    await page.goto(plant.url)
    await expect(page.locator(".unit-card").first).to_be_visible()
    await expect(page.locator(".unit-alarms")).to_be_hidden()
    assert complaints == []


async def shelve_and_back(page: Page) -> None:
    """Announce the alarm anew, in the name that is given for the rest of the session."""
    row = page.locator(LINK)
    await row.get_by_role("button", name="Shelve…").click()
    await row.get_by_role("textbox", name="Your name").fill("A. Name")
    await row.get_by_label("Why it is shelved").fill("to be announced anew")
    await row.get_by_role("button", name="Shelve", exact=True).click()
    await page.locator(f"[data-state=shelved]{LINK}").get_by_role("button", name="Unshelve").click()
    await expect(page.locator(LINK)).to_have_attribute("data-state", "unacknowledged")


async def test_alarms_are_acknowledged_together_and_what_is_refused_is_said(plant, page):
    other = "U1:device:clock_offset"

    async def with_another(route: Route) -> None:
        """Add an alarm that the service has, but that was never raised."""
        headers = {n: v for n, v in route.request.headers.items() if n != "if-none-match"}
        found = await (await route.fetch(headers=headers)).json()
        found["alarms"] += [found["alarms"][0] | {"id": other, "kind": "clock_offset"}]
        await route.fulfill(json=found)

    await page.goto(plant.url + LIST)
    await shelve_and_back(page)
    await page.route("**/api/v1/alarms", with_another)
    row, unreal = page.locator(LINK), page.locator(f"[data-alarm='{other}']")
    await unreal.get_by_role("checkbox", name="Select").check()
    await expect(page.get_by_role("button", name="Acknowledge 1 selected")).to_be_visible()
    await unreal.get_by_role("checkbox", name="Select").uncheck()
    await page.get_by_role("button", name="Acknowledge all 2 shown").click()

    await expect(page.locator(".done")).to_have_text("1 of 2 acknowledged.")
    group = page.locator(".alarm-list div.actions").first
    await expect(group.get_by_role("alert")).to_contain_text("is not the newest")
    await page.unroute_all(behavior="wait")
    await expect(row).to_have_attribute("data-state", "acknowledged")
    await expect(page.get_by_role("button", name="Acknowledge all")).to_be_hidden()


async def test_a_receiver_that_is_away_is_named_until_none_waits(plant, page, receiver_port):
    await page.goto(plant.url + LIST)
    line = page.locator(".delivery li")
    await expect(line).to_contain_text("desk: not delivered since")
    await expect(line).to_contain_text("since")
    await expect(line.locator(".mark")).to_have_attribute("data-look", "bad")

    async with await asyncio.start_server(take, "127.0.0.1", receiver_port):
        await expect(page.locator(".delivery")).to_be_hidden()


async def test_what_has_not_changed_is_not_sent_again_and_stays_on_the_page(plant, page):
    async with page.expect_response(is_nothing_new):
        await page.goto(plant.url + LIST)
    async with page.expect_response(is_nothing_new):
        await expect(page.locator(LINK)).to_be_visible()
    await expect(page.locator(".alarms-head .mark")).to_be_hidden()
    await expect(page.locator("#service")).to_contain_text("Connected")


async def test_a_page_from_before_an_upgrade_says_so_and_loads_the_new_one(plant, page):
    await page.goto(plant.url)
    await expect(page.locator("#service")).to_contain_text("Connected")
    await expect(page.locator("#upgrade")).to_be_hidden()

    async def of_a_later_service(route: Route) -> None:
        asked = {**route.request.headers, "if-none-match": '"of before"'}
        answer = await route.fetch(headers=asked)
        await route.fulfill(response=answer, headers={**answer.headers, "padwatch-edition": "9"})

    await page.route("**/api/v1/overview*", of_a_later_service)
    await expect(page.get_by_text("has been upgraded")).to_be_visible()
    await page.unroute("**/api/v1/overview*")
    await page.get_by_role("button", name="Reload the page").click()
    await expect(page.locator("#service")).to_contain_text("Connected")
    await expect(page.locator("#upgrade")).to_be_hidden()
