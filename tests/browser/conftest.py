"""A real browser: pages of real plants in Chromium."""

import shutil
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from inspect import iscoroutinefunction
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import (
    Browser,
    BrowserContext,
    ConsoleMessage,
    Page,
    async_playwright,
    expect,
)
from pytest_asyncio import is_async_test
from real_plant import Plant

PATIENCE_MS = 90_000
"""Until a number that has to be measured first is there, on a busy machine."""

expect.set_options(timeout=PATIENCE_MS)

SHARED_LOOP = pytest.mark.asyncio(loop_scope="session")

QUIET = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@pytest.hookimpl(tryfirst=True)
def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Mark tests before pytest-asyncio chooses the scope of their event loop.

    Marked later, each test gets a new loop, and with it a new browser.
    """
    if iscoroutinefunction(metafunc.function):
        metafunc.definition.add_marker(SHARED_LOOP, append=False)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run all tests here in the event loop of the browser that they share."""
    for item in items:
        if Path(__file__).parent in item.path.parents and is_async_test(item):
            item.add_marker(SHARED_LOOP, append=False)


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of an installed Chromium; the one without a window takes less processor time."""
    names = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
    return next(filter(None, map(shutil.which, names)), None) or pytest.skip("needs chromium")


@pytest.fixture
def new_plant(chromium: str, tmp_path: Path) -> Iterator[Plant]:  # noqa: ARG001 - skip before start
    """A plant of the test's own, nothing of it running yet."""
    with Plant(tmp_path) as plant:
        yield plant


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def browser(chromium: str) -> AsyncIterator[Browser]:
    """The browser that all tests of a process share."""
    async with async_playwright() as playwright:
        opened = await playwright.chromium.launch(executable_path=chromium, args=QUIET)
        yield opened
        await opened.close()


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def screen(browser: Browser) -> BrowserContext:
    """A control-room screen: what it has loaded once it need not compile again."""
    return await browser.new_context(viewport={"width": 1280, "height": 800})


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def phone(browser: Browser) -> BrowserContext:
    return await browser.new_context(viewport={"width": 360, "height": 780}, has_touch=True)


@asynccontextmanager
async def fresh_page(context: BrowserContext) -> AsyncIterator[Page]:
    """A page that finds nothing of the pages before it: no login, no choices."""
    context.set_default_timeout(PATIENCE_MS)
    yield await context.new_page()
    for opened in context.pages:
        if opened.url.startswith("http"):
            await opened.evaluate("localStorage.clear()")
        await opened.close()
    await context.clear_cookies()


@pytest_asyncio.fixture(loop_scope="session")
async def page(screen: BrowserContext) -> AsyncIterator[Page]:
    """A page on a control-room screen."""
    async with fresh_page(screen) as opened:
        yield opened


@pytest_asyncio.fixture(loop_scope="session")
async def remote_page(page: Page) -> Page:
    """A page on a screen elsewhere, behind the plant's proxy: there one must log in."""
    await page.set_extra_http_headers({"X-Forwarded-For": "192.0.2.7"})
    return page


@pytest_asyncio.fixture(loop_scope="session")
async def phone_page(phone: BrowserContext) -> AsyncIterator[Page]:
    """A page on a phone."""
    async with fresh_page(phone) as opened:
        yield opened


@pytest.fixture
def complaints(page: Page) -> list[str]:
    """Complaints of the page's console."""
    found: list[str] = []

    def note(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            found.append(message.text)

    page.on("console", note)
    page.on("pageerror", lambda error: found.append(str(error)))
    return found
