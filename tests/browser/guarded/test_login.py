"""Who looks at a plant from elsewhere logs in first, and is offered what his role may do."""

import json
import re

from on_screen import log_in
from playwright.async_api import Page, Route, expect

ALARMS = "#/alarms"
ROW = "[data-alarm='U1:link:link_lost']"


async def open_alarms(page: Page, url: str, name: str) -> None:
    await page.goto(url + ALARMS)
    await log_in(page, name)
    await expect(page.locator(ROW)).to_be_visible()


async def test_nothing_of_the_plant_shows_before_a_login_which_leads_on_to_the_page_asked_for(
    plant, remote_page, complaints
) -> None:
    page = remote_page
    await page.goto(plant.url + ALARMS)
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()
    await expect(page.get_by_label("Name", exact=True)).to_be_focused()
    await expect(page.locator("#plant")).to_be_empty()
    await expect(page.locator("#alarms")).to_be_hidden()
    await expect(page.get_by_role("navigation").get_by_role("link")).to_have_count(0)
    await log_in(page, "operator")
    await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()
    assert page.url.endswith(ALARMS)
    await expect(page.locator(".person")).to_contain_text("operator, operator")
    await page.reload()
    await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()
    assert complaints == []


async def test_a_wrong_password_is_said_in_a_sentence_and_many_make_one_wait(
    plant, remote_page
) -> None:
    page = remote_page
    await page.goto(plant.url)
    button = page.locator(".entries button")
    said = page.get_by_role("alert").filter(visible=True)
    await log_in(page, "operator", "not the password")
    await expect(said).to_contain_text("wrong")

    async def refuse(route: Route) -> None:
        problem = {"title": "Too many attempts", "detail": "wait before the next login"}
        headers = {"Content-Type": "application/problem+json", "Retry-After": "2"}
        await route.fulfill(status=429, headers=headers, body=json.dumps(problem))

    await page.route("**/api/v1/session", refuse)
    await log_in(page, "operator")
    await expect(said).to_contain_text("Wait before the next login.")
    await expect(button).to_have_text(re.compile(r"Wait \d s"))
    await expect(button).to_be_disabled()
    await expect(page.locator(".person")).to_be_hidden()
    await page.unroute("**/api/v1/session")
    await expect(button).to_have_text("Log in")
    await log_in(page, "operator")
    await expect(page.locator(".person")).to_contain_text("operator, operator")


async def test_a_viewer_is_told_what_he_may_not_do_and_not_offered_it(plant, remote_page) -> None:
    page = remote_page
    await open_alarms(page, plant.url, "viewer")
    await expect(page.locator(f"{ROW} button:visible")).to_have_count(0)
    await expect(page.locator(".limit")).to_contain_text("takes the role operator")
    await expect(page.locator("#actor")).to_have_count(0)
    await expect(page.get_by_role("link", name="Audit")).to_be_hidden()
    await page.goto(plant.url + "#/audit")
    await expect(page.get_by_text("takes the role engineer")).to_be_visible()


async def test_an_operator_acts_in_his_own_name_and_leaves_baselines_alone(
    plant, remote_page
) -> None:
    page = remote_page
    await open_alarms(page, plant.url, "operator")
    await page.locator(ROW).get_by_role("button", name="Comment…").click()
    await page.get_by_label("Comment", exact=True).fill("the DAQ is being painted")
    await page.keyboard.press("Enter")
    history = page.locator("table[aria-label=History]")
    await expect(history).to_contain_text("the DAQ is being painted")
    await expect(history.get_by_role("row").filter(has_text="painted")).to_contain_text("operator")
    await page.goto(plant.url + "#/units/U1/bearings/UJB/film")
    await expect(page.locator(".limit")).to_contain_text("takes the role engineer")


async def test_a_login_that_ends_leads_to_the_door_and_back_to_the_same_page(
    plant, remote_page
) -> None:
    page = remote_page
    await open_alarms(page, plant.url, "engineer")
    await page.context.clear_cookies()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()
    assert page.url.endswith(ALARMS)
    await log_in(page, "operator")
    await expect(page.locator(ROW)).to_be_visible()
    await page.get_by_role("button", name="Log out").click()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()
    await page.reload()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()
