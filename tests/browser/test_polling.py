"""An open page asks for what is new, and says when the service has become another one."""

from on_screen import DATA_MS
from playwright.async_api import Page, Response, Route, expect


def is_nothing_new(response: Response) -> bool:
    return response.url.endswith("/api/v1/alarms") and response.status == 304


async def test_what_has_not_changed_is_not_sent_again_and_stays_on_the_page(
    guarded_plant, page: Page
) -> None:
    async with page.expect_response(is_nothing_new, timeout=DATA_MS):
        await page.goto(guarded_plant.url + "#/alarms")
    async with page.expect_response(is_nothing_new, timeout=DATA_MS):
        await expect(page.locator("[data-alarm='U1:link:link_lost']")).to_be_visible()
    await expect(page.locator(".alarms-head .mark")).to_be_hidden()
    await expect(page.locator("#service")).to_contain_text("Service answered")


async def test_a_page_from_before_an_upgrade_says_so_and_loads_the_new_one(
    guarded_plant, page: Page, picture_of
) -> None:
    await page.goto(guarded_plant.url)
    await expect(page.locator("#service")).to_contain_text("Service answered", timeout=DATA_MS)
    await expect(page.locator("#upgrade")).to_be_hidden()

    async def of_a_later_service(route: Route) -> None:
        asked = {**route.request.headers, "if-none-match": '"of before"'}
        answer = await route.fetch(headers=asked)
        await route.fulfill(response=answer, headers={**answer.headers, "padwatch-edition": "9"})

    await page.route("**/api/v1/overview", of_a_later_service)
    await expect(page.get_by_text("has been upgraded")).to_be_visible(timeout=DATA_MS)
    await picture_of(page, "upgraded")
    await page.unroute("**/api/v1/overview")
    await page.get_by_role("button", name="Reload the page").click()
    await expect(page.locator("#service")).to_contain_text("Service answered", timeout=DATA_MS)
    await expect(page.locator("#upgrade")).to_be_hidden()
