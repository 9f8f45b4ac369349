"""The page of accounts and keys: an admin lets people and machines in, and shuts them out again."""

import pytest
from on_screen import DATA_MS
from playwright.async_api import Page, expect

pytestmark = pytest.mark.asyncio(loop_scope="session")

ACCESS = "#/access"
NEW = "[data-account=newcomer]"
FIELDS = ("password", "new-password", "new-password-again")


async def open_access(page: Page, url: str, password: str) -> None:
    await page.goto(url + ACCESS)
    await page.get_by_label("Name", exact=True).fill("admin")
    await page.get_by_label("Password", exact=True).fill(password)
    await page.keyboard.press("Enter")
    await expect(page.locator("[data-account=admin]")).to_be_visible(timeout=DATA_MS)


async def test_an_admin_adds_changes_and_removes_accounts_and_reads_what_is_refused(
    plant, remote_page, password, complaints_of, picture_of
) -> None:
    page = remote_page
    await open_access(page, plant.url, password)
    complaints = complaints_of(page)
    shown = await page.locator(".accounts tbody th").all_inner_texts()
    assert shown == ["admin", "engineer", "operator", "viewer"]
    await page.get_by_role("button", name="Add somebody…").press("Enter")
    form = page.locator(".accounts > form")
    await expect(form.get_by_label("Name")).to_be_focused()
    await page.keyboard.type("newcomer")
    await form.get_by_label("Password").fill(password)
    await page.keyboard.press("Enter")
    await expect(page.locator(NEW)).to_contain_text("viewer")
    await expect(page.get_by_role("button", name="Add somebody…")).to_be_focused()

    await page.get_by_role("button", name="Role newcomer").press("Enter")
    await page.locator(".question:visible select").select_option("operator")
    await page.get_by_role("button", name="Set role").press("Enter")
    await expect(page.locator(NEW)).to_contain_text("operator")
    await picture_of(page, "accounts")

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
    plant, remote_page, password, browser, picture_of
) -> None:
    page = remote_page
    await open_access(page, plant.url, password)
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
    await picture_of(page, "key")

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


async def test_whoever_is_logged_in_changes_his_own_password(
    plant, remote_page, password, browser
) -> None:
    page, other = remote_page, f"{password} and cold"
    await open_access(page, plant.url, password)
    await page.locator(".person").get_by_role("link", name="Password").press("Enter")
    now, wanted, again = (page.locator(f".door input[name={name}]") for name in FIELDS)
    await now.fill(password)
    await wanted.fill(other)
    await again.fill(other + "er")
    await page.keyboard.press("Enter")
    await expect(page.get_by_role("alert").filter(visible=True)).to_contain_text("not the same")
    await again.fill(other)
    await page.keyboard.press("Enter")
    said = page.get_by_text("Your password is changed.")
    await expect(said).to_be_visible(timeout=DATA_MS)
    at = f"{plant.url}api/v1"
    elsewhere = await browser.new_context()
    found = await elsewhere.request.post(f"{at}/session", data={"name": "admin", "password": other})
    assert found.status == 201
    await elsewhere.clear_cookies()
    back = await elsewhere.request.put(f"{at}/accounts/admin/password", data={"password": password})
    assert back.ok
    await elsewhere.close()
