"""The page of accounts and keys: an admin lets people and machines in, and shuts them out again."""

from collections.abc import AsyncIterator

import pytest_asyncio
from on_screen import log_in
from playwright.async_api import APIRequestContext, Page, Route, expect
from real_plant import PASSWORD

ACCESS = "#/access"
PAINTER = "painter"
NEW = "[data-account=newcomer]"
FIELDS = ("password", "new-password", "new-password-again")


async def open_access(page: Page, url: str) -> None:
    await page.goto(url + ACCESS)
    await log_in(page, "admin")
    await expect(page.locator("[data-account=admin]")).to_be_visible()


async def test_an_admin_adds_changes_and_removes_accounts_and_reads_what_is_refused(
    plant, remote_page, complaints
) -> None:
    page = remote_page
    await open_access(page, plant.url)
    shown = await page.locator(".accounts tbody th").all_inner_texts()
    assert shown == ["admin", "engineer", "operator", "viewer"]
    await page.get_by_role("button", name="Add somebody…").press("Enter")
    form = page.locator(".accounts > form")
    await expect(form.get_by_label("Name")).to_be_focused()
    await page.keyboard.type("newcomer")
    await form.get_by_label("Password").fill(PASSWORD)
    await page.keyboard.press("Enter")
    await expect(page.locator(NEW)).to_contain_text("viewer")
    await expect(page.get_by_role("button", name="Add somebody…")).to_be_focused()

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
    await expect(said).to_contain_text("his own account")
    await page.get_by_role("button", name="Add somebody…").click()
    await form.get_by_label("Name").fill("newcomer")
    await form.get_by_label("Password").fill("short")
    await page.keyboard.press("Enter")
    await expect(form.get_by_role("alert")).not_to_be_empty()
    await expect(page.locator(NEW)).to_have_count(0)


async def test_a_key_is_shown_once_opens_until_it_is_revoked_and_then_no_more(
    plant, remote_page, browser
) -> None:
    page = remote_page
    await open_access(page, plant.url)
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


async def test_an_own_password_is_changed_and_a_change_without_an_answer_is_reported(
    plant, remote_page, local
) -> None:
    page, other, api = remote_page, f"{PASSWORD} and cold", f"{plant.url}api/v1"
    await page.goto(plant.url)
    await log_in(page, PAINTER)
    await page.locator(".person").get_by_role("link", name="Password").press("Enter")
    now, wanted, again = (page.locator(f".door input[name={name}]") for name in FIELDS)
    await now.fill(PASSWORD)
    await wanted.fill(other)
    await again.fill(other + "er")
    await page.keyboard.press("Enter")
    await expect(page.get_by_role("alert").filter(visible=True)).to_contain_text("not the same")
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
    await expect(page.get_by_role("alert").filter(visible=True)).to_contain_text("wrong")
    await log_in(page, PAINTER)
    await expect(page.get_by_role("heading", name="Your password")).to_be_visible()
    await page.get_by_role("button", name="Log out").click()
    await expect(page.get_by_role("heading", name="Log in")).to_be_visible()
    await expect(doubt).to_be_hidden()
