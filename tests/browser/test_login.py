"""Who looks at a plant from elsewhere logs in first, and is offered what his role may do."""

import re

from on_screen import DATA_MS
from playwright.async_api import Page, expect

ALARMS = "#/alarms"
ROW = "[data-alarm='U1:link:link_lost']"


async def log_in(page: Page, name: str, password: str) -> None:
    await page.get_by_label("Name", exact=True).fill(name)
    await page.get_by_label("Password", exact=True).fill(password)
    await page.keyboard.press("Enter")


async def open_alarms(page: Page, url: str, name: str, password: str) -> None:
    await page.goto(url + ALARMS)
    await log_in(page, name, password)
    await expect(page.locator(ROW)).to_be_visible(timeout=DATA_MS)


async def test_nothing_of_the_plant_shows_before_a_login_which_leads_on_to_the_page_asked_for(
    guarded_plant, remote_page, password, complaints_of, picture_of
) -> None:
    page = remote_page
    complaints = complaints_of(page)
    await page.goto(guarded_plant.url + ALARMS)
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible(timeout=DATA_MS)
    await expect(page.get_by_label("Name", exact=True)).to_be_focused()
    await expect(page.locator("#plant")).to_be_empty()
    await expect(page.locator("#alarms")).to_be_hidden()
    await expect(page.get_by_role("navigation").get_by_role("link")).to_have_count(0)
    await picture_of(page, "door")
    await log_in(page, "operator", password)
    await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()
    assert page.url.endswith(ALARMS)
    await expect(page.locator(".person")).to_contain_text("operator, operator")
    await page.reload()
    await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()
    assert complaints == []


async def test_a_wrong_password_is_said_in_a_sentence_and_many_make_one_wait(
    new_plant, remote_page, password
) -> None:
    page = remote_page
    new_plant.add_account("anna", "operator", password)
    new_plant.start_service()
    await page.goto(new_plant.url)
    button = page.locator(".entries button")
    said = page.get_by_role("alert").filter(has_text=re.compile("wrong|wait", re.IGNORECASE))
    words = ""
    for _ in range(9):  # each wait is twice as long as the one before, so that one is seen
        await expect(button).to_be_enabled(timeout=DATA_MS)
        await log_in(page, "anna", "not " + password)
        await expect(said).to_be_visible(timeout=DATA_MS)
        words = await button.inner_text()
        if words != "Log in":
            break
    assert re.fullmatch(r"Wait \d+ s", words)
    await expect(page.locator(".person")).to_be_hidden()
    await expect(button).to_have_text("Log in", timeout=DATA_MS)
    await log_in(page, "anna", password)
    await expect(page.locator(".person")).to_contain_text("anna, operator", timeout=DATA_MS)


async def test_a_viewer_is_told_what_he_may_not_do_and_not_offered_it(
    guarded_plant, remote_page, password, picture_of
) -> None:
    page = remote_page
    await open_alarms(page, guarded_plant.url, "viewer", password)
    await expect(page.locator(f"{ROW} button:visible")).to_have_count(0)
    await expect(page.locator(".limit")).to_contain_text("takes the role operator")
    await expect(page.locator("#actor")).to_have_count(0)
    await expect(page.get_by_role("link", name="Audit")).to_be_hidden()
    await picture_of(page, "alarms")
    await page.goto(guarded_plant.url + "#/audit")
    await expect(page.get_by_text("takes the role engineer")).to_be_visible()


async def test_an_operator_acts_in_his_own_name_and_leaves_baselines_alone(
    guarded_plant, remote_page, password, picture_of
) -> None:
    page = remote_page
    await open_alarms(page, guarded_plant.url, "operator", password)
    await page.locator(ROW).get_by_role("button", name="Comment…").click()
    await page.get_by_label("Comment", exact=True).fill("the DAQ is being painted")
    await page.keyboard.press("Enter")
    history = page.locator("table[aria-label=History]")
    await expect(history).to_contain_text("the DAQ is being painted", timeout=DATA_MS)
    await expect(history.get_by_role("row").filter(has_text="painted")).to_contain_text("operator")
    await picture_of(page, "alarms")
    await page.goto(guarded_plant.url + "#/units/U1/bearings/UJB/film")
    await expect(page.locator(".limit")).to_contain_text("takes the role engineer")


async def test_a_login_that_ends_leads_to_the_door_and_back_to_the_same_page(
    guarded_plant, remote_page, password
) -> None:
    page = remote_page
    await open_alarms(page, guarded_plant.url, "engineer", password)
    await page.context.clear_cookies()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible(timeout=DATA_MS)
    assert page.url.endswith(ALARMS)
    await log_in(page, "operator", password)
    await expect(page.locator(ROW)).to_be_visible(timeout=DATA_MS)
    await page.get_by_role("button", name="Log out").click()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()
    await page.reload()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()


async def test_the_first_account_is_made_with_the_token_and_lasts_over_a_restart(
    new_plant, page, password, complaints_of, picture_of
) -> None:
    new_plant.settings += "[access]\nlogin = true\n"
    new_plant.start_service()
    complaints = complaints_of(page)
    await page.goto(new_plant.url + ALARMS)
    await expect(page.get_by_role("heading", name="Set up padwatch")).to_be_visible()
    await page.get_by_label("Token").fill(new_plant.token)
    await page.get_by_label("Your name").fill("anna")
    await page.get_by_label("Password", exact=True).fill(password)
    await page.get_by_label("Password again").fill("another than that")
    await page.keyboard.press("Enter")
    await expect(page.get_by_role("alert")).to_contain_text("are not the same")
    await picture_of(page, "set-up")
    await page.get_by_label("Password again").fill(password)
    await page.keyboard.press("Enter")
    await expect(page.locator(".person")).to_contain_text("anna, admin", timeout=DATA_MS)
    await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()
    assert complaints == []

    new_plant.stop_service()
    await expect(page.locator("#failure")).to_contain_text("Service not reachable")
    new_plant.start_service()
    await expect(page.locator("#banner")).to_be_hidden(timeout=DATA_MS)
    await expect(page.locator(".person")).to_contain_text("anna, admin")
    await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()
