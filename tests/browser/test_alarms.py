"""The alarm list: what is wrong is seen on every page, acknowledged by name and shelved."""

import re
from pathlib import Path

import pytest
from on_screen import DATA_MS
from playwright.async_api import expect

from core.alarms.alarm import AlarmKind, AlarmState
from core.alarms.event import AlarmChange

LIST = "#/alarms"
LINK = "[data-alarm='U1:link:link_lost']"

WORDS = Path(__file__).parents[2] / "service" / "dashboard" / "static" / "alarm_words.js"
ENTRY = re.compile(r"^  (\w+): \"[^\"]{3,40}\",$", re.MULTILINE)


def keys(table: str) -> set[str]:
    body = re.search(rf"^const {table} = {{$(.*?)^}};$", WORDS.read_text(), re.M | re.S)
    assert body is not None, f"alarm_words.js has no table {table}"
    return set(ENTRY.findall(body[1]))


@pytest.mark.parametrize(
    ("table", "codes"),
    [("KINDS", AlarmKind), ("STATES", AlarmState), ("CHANGES", AlarmChange)],
    ids=["kinds", "states", "changes"],
)
def test_every_code_of_an_alarm_has_words(table, codes) -> None:
    assert keys(table) == {code.value for code in codes}


async def test_a_plant_in_good_health_says_that_there_are_no_alarms(running_plant, page) -> None:
    await page.goto(running_plant.url)
    link = page.locator("#alarms")
    await expect(link).to_contain_text("No alarms", timeout=DATA_MS)

    await link.click()
    await expect(page.locator("h1")).to_have_text("Alarms")
    await expect(page.get_by_text("Nothing is on the list.")).to_be_visible()
    await expect(link).to_have_attribute("aria-current", "page")


async def test_how_often_alarms_come_is_said_in_one_line(running_plant, page) -> None:
    await page.goto(f"{running_plant.url}{LIST}")

    line = page.locator(".alarm-rates")
    await expect(line).to_contain_text("Seven days: ", timeout=DATA_MS)
    for words in ("a day", "in ten minutes, at most", "chattering", "standing for more than a day"):
        await expect(line).to_contain_text(words)


@pytest.mark.long
async def test_a_lost_link_is_announced_acknowledged_shelved_and_returns(
    new_plant, page, picture_of, complaints_of
) -> None:
    complaints = complaints_of(page)
    new_plant.start_daq()
    new_plant.start_service()
    await page.goto(new_plant.url)
    await expect(page.locator("#alarms")).to_contain_text("No alarms", timeout=DATA_MS)

    new_plant.stop_daq()
    head = page.locator("#alarms .mark")
    await expect(head).to_contain_text("1 alarm, 1 not acknowledged", timeout=DATA_MS)
    await expect(head).to_have_attribute("data-look", "uncertain")
    await page.locator("#alarms").click()
    row = page.locator(LINK)
    await expect(row).to_contain_text("Not acknowledged")
    await expect(row).to_contain_text("Link lost")
    await expect(row.locator(".mark")).to_have_text("Alert")
    await expect(page.locator(".unjudged summary")).to_contain_text("cannot be judged now")
    await picture_of(page, "list")

    await row.get_by_role("button", name="Acknowledge").click()
    await expect(row.get_by_role("alert")).to_have_text("Give your name first.")
    await page.get_by_label("Your name").fill("A. Name")
    await row.get_by_role("button", name="Acknowledge").click()
    await expect(row).to_have_attribute("data-state", "acknowledged")
    await expect(row.get_by_role("button", name="Acknowledge")).to_be_hidden()
    await expect(head).to_contain_text("1 alarm, 15 not judged")

    await row.get_by_role("button", name="Comment…").click()
    await row.get_by_label("Comment").fill("the cable is pulled for a test")
    await row.get_by_role("button", name="Comment", exact=True).click()
    await expect(row.get_by_label("Comment")).to_be_hidden()

    await row.get_by_role("button", name="Shelve…").click()
    await row.get_by_label("Why it is shelved").fill("the DAQ is being changed")
    await row.get_by_role("button", name="Shelve", exact=True).click()
    hidden = page.get_by_role("table", name="Taken off the list").locator(LINK)
    await expect(hidden).to_contain_text("Shelved by A. Name until")
    await expect(hidden).to_contain_text("the DAQ is being changed")
    await picture_of(page, "shelved")
    await hidden.get_by_role("button", name="Unshelve").click()
    await expect(page.get_by_role("table", name="On the list").locator(LINK)).to_have_attribute(
        "data-state", "unacknowledged"
    )

    new_plant.start_daq()
    await expect(row).to_have_attribute("data-state", "returned_unacknowledged", timeout=DATA_MS)
    await row.get_by_role("button", name="Acknowledge").click()
    await expect(page.get_by_text("Nothing is on the list.")).to_be_visible()
    history = page.get_by_role("table", name="History")
    await expect(history).to_contain_text("the cable is pulled for a test")
    for words in (
        "raised",
        "commented",
        "acknowledged",
        "shelved",
        "back from the shelf",
        "returned",
    ):
        await expect(history.get_by_role("cell", name=words, exact=True).first).to_be_visible()
    assert complaints == []


async def test_a_service_that_stops_answering_leaves_a_list_that_says_how_old_it_is(
    new_plant, page
) -> None:
    new_plant.start_daq()
    new_plant.start_service()
    await page.goto(new_plant.url + LIST)
    await expect(page.locator("#alarms")).to_contain_text("No alarms", timeout=DATA_MS)

    new_plant.stop_service()

    await expect(page.locator(".alarms-head .mark")).to_contain_text(
        "what has happened since is not"
    )
    await expect(page.locator("#alarms")).to_contain_text("Alarms unknown", timeout=30_000)


async def test_the_alarm_list_fits_a_phone(running_plant, phone_page, picture_of) -> None:
    await phone_page.goto(running_plant.url + LIST)
    await expect(phone_page.get_by_text("Nothing is on the list.")).to_be_visible(timeout=DATA_MS)
    widths = "() => [document.documentElement.scrollWidth, window.innerWidth]"
    width, visible = await phone_page.evaluate(widths)
    assert width <= visible
    await picture_of(phone_page, "list")
