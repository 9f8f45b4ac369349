"""Who gets in: first account, login, roles, and the page of accounts and keys."""

import json
import re
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from on_screen import log_in
from playwright.async_api import APIRequestContext, Page, Route, expect
from real_plant import PASSWORD
from rigs.tiers import first_fast

ALARMS = "#/alarms"
ROW = "[data-alarm='U1:link:link_lost']"
PAINTER = "painter"
NEW = "[data-account=newcomer]"
FIELDS = ("password", "new-password", "new-password-again")


@pytest.mark.parametrize("n_restarts", first_fast(1, [0, 1]))
async def test_the_first_account_is_made_with_the_token_and_lasts_over_a_restart(
    new_plant, page, complaints, n_restarts
):
    new_plant.is_open = False
    if n_restarts:
        new_plant.settings += "[access]\nlogin = true\n"
    new_plant.start_service()
    await page.goto(new_plant.url + ALARMS)
    if not n_restarts:  # on this computer one sees the plant, and logs in to act
        await expect(page.locator(".limit")).to_contain_text("log in")
        await page.get_by_role("link", name="Log in").click()
    await expect(page.get_by_role("heading", name="Set up padwatch")).to_be_visible()
    await page.get_by_label("Token").fill(new_plant.read_token())
    await page.get_by_label("Your name").fill("anna")
    await page.get_by_label("Password", exact=True).fill(PASSWORD)
    await page.get_by_label("Password again").fill("another than that")
    await page.keyboard.press("Enter")
    await expect(page.get_by_role("alert")).to_contain_text("are not the same")
    await page.get_by_label("Password again").fill(PASSWORD)
    await page.keyboard.press("Enter")
    await expect(page.locator(".person")).to_contain_text("anna, admin")
    await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()
    assert complaints == []

    for _ in range(n_restarts):
        new_plant.stop_service()
        await expect(page.locator("#failure")).to_contain_text("Service not reachable")
        new_plant.start_service()
        await expect(page.locator("#banner")).to_be_hidden()
        await expect(page.locator(".person")).to_contain_text("anna, admin")
        await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()


async def open_as(page: Page, name: str, address: str, awaited: str = ROW) -> None:
    await page.goto(address)
    await log_in(page, name)
    await expect(page.locator(awaited)).to_be_visible()


async def test_nothing_of_the_plant_shows_before_a_login_which_leads_on_to_the_page_asked_for(
    plant, remote_page, complaints
):
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


async def test_a_wrong_password_is_said_in_a_sentence_and_many_make_one_wait(plant, remote_page):
    page = remote_page
    await page.goto(plant.url)
    button = page.locator(".entries button")
    said = page.locator(".entries").get_by_role("alert")
    await log_in(page, "operator", "not the password")
    await expect(said).to_contain_text("wrong")

    async def refuse(route: Route) -> None:
        if route.request.method != "POST":
            await route.continue_()
            return
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


async def test_a_viewer_is_told_what_he_may_not_do_and_not_offered_it(plant, remote_page):
    page = remote_page
    await open_as(page, "viewer", plant.url + ALARMS)
    await expect(page.locator(f"{ROW} button:visible")).to_have_count(0)
    await expect(page.locator(".limit")).to_contain_text("takes the role operator")
    await expect(page.get_by_role("textbox", name="Your name")).to_have_count(0)
    await expect(page.get_by_role("link", name="Audit")).to_be_hidden()
    await page.goto(plant.url + "#/audit")
    await expect(page.get_by_text("takes the role engineer")).to_be_visible()


async def test_an_operator_acts_in_his_own_name_and_leaves_baselines_alone(plant, remote_page):
    page = remote_page
    await open_as(page, "operator", plant.url + ALARMS)
    await page.locator(ROW).get_by_role("button", name="Comment…").click()
    await page.get_by_label("Comment", exact=True).fill("the DAQ is being painted")
    await page.keyboard.press("Enter")
    history = page.locator("table[aria-label=History]")
    await expect(history).to_contain_text("the DAQ is being painted")
    await expect(history.get_by_role("row").filter(has_text="painted")).to_contain_text("operator")
    await page.goto(plant.url + "#/units/U1/bearings/UJB/film")
    await expect(page.locator(".limit")).to_contain_text("takes the role engineer")


async def test_a_login_that_ends_leads_to_the_door_and_back_to_the_same_page(plant, remote_page):
    page = remote_page
    await open_as(page, "engineer", plant.url + ALARMS)
    await page.context.clear_cookies()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()
    assert page.url.endswith(ALARMS)
    await log_in(page, "operator")
    await expect(page.locator(ROW)).to_be_visible()
    await page.get_by_role("button", name="Log out").click()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()
    await page.reload()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()


@pytest.mark.long
async def test_an_admin_adds_changes_and_removes_accounts_and_reads_what_is_refused(
    plant, remote_page, complaints
):
    page = remote_page
    await open_as(page, "admin", plant.url + "#/access", "[data-account=admin]")
    shown = await page.locator(".accounts tbody th").all_inner_texts()
    assert shown == ["admin", "engineer", "operator", "viewer"]
    await page.get_by_role("button", name="Add account…").press("Enter")
    form = page.locator(".accounts > form")
    await expect(form.get_by_label("Name")).to_be_focused()
    await page.keyboard.type("newcomer")
    await form.get_by_label("Password").fill(PASSWORD)
    await page.keyboard.press("Enter")
    await expect(page.locator(NEW)).to_contain_text("viewer")
    await expect(page.get_by_role("button", name="Add account…")).to_be_focused()

    await page.get_by_role("button", name="Role newcomer").press("Enter")
    await page.locator(".question:visible select").select_option("operator")
    await page.get_by_role("button", name="Set role").press("Enter")
    await expect(page.locator(NEW)).to_contain_text("operator")

    await page.get_by_role("button", name="Remove newcomer").press("Enter")
    await page.keyboard.press("Escape")
    await expect(page.locator(".question:visible")).to_have_count(0)
    await page.get_by_role("button", name="Remove newcomer").press("Enter")
    await page.get_by_role("button", name="Remove", exact=True).press("Enter")
    await expect(page.locator(NEW)).to_have_count(0)
    assert complaints == []

    said = page.get_by_role("alert").filter(visible=True)
    await page.get_by_role("button", name="Remove admin").click()
    await page.get_by_role("button", name="Remove", exact=True).click()
    await expect(said).to_contain_text("your own account")
    await page.get_by_role("button", name="Add account…").click()
    await form.get_by_label("Name").fill("newcomer")
    await form.get_by_label("Password").fill("short")
    await page.keyboard.press("Enter")
    await expect(form.get_by_role("alert")).not_to_be_empty()
    await expect(page.locator(NEW)).to_have_count(0)


async def test_a_key_is_shown_once_and_opens_until_it_is_revoked(plant, remote_page, browser):
    page = remote_page
    await open_as(page, "admin", plant.url + "#/access", "[data-account=admin]")
    await page.get_by_role("button", name="Create a key…").press("Enter")
    await page.get_by_label("What it is for").fill("historian")
    await page.keyboard.press("Enter")
    shown = page.get_by_label("The new key")
    await expect(shown).to_be_visible()
    await expect(shown).to_be_focused()
    key = await shown.input_value()
    row = page.locator("[data-key]", has_text="historian")
    await expect(row).to_contain_text("Valid")
    await expect(row).to_contain_text("never")

    headers = {"Authorization": f"Bearer {key}", "X-Forwarded-For": "192.0.2.7"}
    asked = await browser.new_context(extra_http_headers=headers)
    assert (await asked.request.get(f"{plant.url}api/v1/overview")).status == 200
    await page.get_by_role("button", name="Revoke historian").press("Enter")
    await page.get_by_role("button", name="Revoke", exact=True).press("Enter")
    await expect(row).to_contain_text("Revoked")
    assert (await asked.request.get(f"{plant.url}api/v1/overview")).status == 401
    await page.reload()
    await expect(row).to_contain_text("Revoked")
    await expect(page.get_by_label("The new key")).to_be_hidden()
    await asked.close()


@pytest_asyncio.fixture(loop_scope="session")
async def local(plant, browser) -> AsyncIterator[APIRequestContext]:
    """Requests from the machine of the service itself, while a painter has an account."""
    context = await browser.new_context()
    accounts = f"{plant.url}api/v1/accounts"
    painter = {"name": PAINTER, "role": "viewer", "password": PASSWORD}
    assert (await context.request.post(accounts, data=painter)).status == 201
    yield context.request
    await context.clear_cookies()
    await context.request.delete(f"{accounts}/{PAINTER}")
    await context.close()


@pytest.mark.long
async def test_an_own_password_is_changed_and_a_change_without_an_answer_is_reported(
    plant, remote_page, local
):
    page, other, api = remote_page, f"{PASSWORD} and cold", f"{plant.url}api/v1"
    await page.goto(f"{plant.url}#/password")
    await log_in(page, PAINTER)
    await expect(page.get_by_text("An administrator set your password")).to_be_visible()
    now, wanted, again = (page.locator(f".door input[name={name}]") for name in FIELDS)
    await now.fill(PASSWORD)
    await wanted.fill(other)
    await again.fill(other + "er")
    await page.keyboard.press("Enter")
    await expect(page.locator(".entries").get_by_role("alert")).to_contain_text("not the same")
    await again.fill(other)
    await page.keyboard.press("Enter")
    await expect(page.get_by_text("Your password is changed.")).to_be_visible()

    async def lose_answer(route: Route) -> None:
        address = f"{api}/accounts/{PAINTER}/password"
        assert (await local.put(address, data={"password": PASSWORD})).ok
        await route.abort()

    await page.route("**/session/password", lose_answer)
    for field, text in ((now, other), (wanted, PASSWORD), (again, PASSWORD)):
        await field.fill(text)
    await page.keyboard.press("Enter")
    doubt = page.get_by_text("has not confirmed the change of your password")
    await expect(doubt).to_be_visible()
    await log_in(page, PAINTER, other)
    await expect(page.locator(".entries").get_by_role("alert")).to_contain_text("wrong")
    await log_in(page, PAINTER)
    await expect(page.get_by_role("heading", name="Your password")).to_be_visible()
    await page.get_by_role("button", name="Log out").click()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()
    await expect(doubt).to_be_hidden()
