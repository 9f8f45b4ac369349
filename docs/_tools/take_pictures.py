"""Take pictures of every page of the dashboard: `make screenshots`.

Starts the demo plant, waits for its danger and the recording made for it (some ten minutes), makes
an account and a key, and takes each page light and dark, on a screen and on a phone, into
build/screenshots; what the documentation shows goes to docs/pictures as well. `--url` takes a
service that runs already; its accounts and keys stay as they are. At last, or alone with the name
"twenty", a plant of twenty units is started for half a minute.
"""

import argparse
import asyncio
import base64
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from ingest import padwatch, plant_file
from palette import Pixels, indexed_png
from pictures import IN_THE_GUIDE, PAGES, PHONE, SCREEN, TWENTY, Picture, every_look
from playwright.async_api import APIRequestContext, Browser, Page, async_playwright

DOCS = Path(__file__).parents[1]
EVERY = DOCS.parent / "build" / "screenshots"
GUIDE = DOCS / "pictures"
WAIT_S = 1200.0
TWENTY_S = 90.0
DRAWN_MS = 30_000
CHARTS_MS = 1500
MOST_HEIGHT = 1300
ELSEWHERE = {"X-Forwarded-For": "192.0.2.7"}
NOW_IS_KNOWN = "() => !document.querySelector('#main').innerText.includes('Asking the service.')"
QUICK_ANALYSIS = "[analysis]\nsegment_samples = 2048\nn_segments = 6\n\n"
PIXELS = """
async (png) => {
  const blob = await (await fetch(`data:image/png;base64,${png}`)).blob();
  const bitmap = await createImageBitmap(blob);
  const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
  const context = canvas.getContext("2d");
  context.drawImage(bitmap, 0, 0);
  const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
  let text = "";
  for (let at = 0; at < data.length; at += 32768) {
    text += String.fromCharCode(...data.subarray(at, at + 32768));
  }
  return [bitmap.width, bitmap.height, btoa(text)];
}
"""


def main() -> None:
    """Take all pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="only these pages, as overview")
    parser.add_argument("--url", help="of a service that runs")
    parser.add_argument("--guide", action="store_true", help="only what the documentation shows")
    options = parser.parse_args()
    wanted = [page for page in PAGES if not options.names or page.name in options.names]
    looks = looks_of(wanted, options)
    for folder in (EVERY, GUIDE):
        folder.mkdir(parents=True, exist_ok=True)
    if options.url and wanted:
        asyncio.run(take_all(options.url, looks))
    elif wanted:
        with demo() as url:
            asyncio.run(prepare(url))
            asyncio.run(take_all(url, looks))
    if not options.names or TWENTY.name in options.names:
        with twenty_units() as url:
            time.sleep(TWENTY_S)
            asyncio.run(take_all(url, looks_of([TWENTY], options)))


def looks_of(pages: list[Picture], options: argparse.Namespace) -> list[Picture]:
    """Return all variants of the selected pages."""
    looks = [look for page in pages for look in every_look(page)]
    return [look for look in looks if not options.guide or look.name in IN_THE_GUIDE]


@contextmanager
def demo() -> Iterator[str]:
    """Run the demo plant; yield the address of its dashboard."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "service.cli.main", "demo", "--port", "0"]
        process = subprocess.Popen(  # noqa: S603 - our own program
            [*command, "--data-folder", folder], stdout=subprocess.PIPE, text=True
        )
        try:
            lines = process.stdout or ()
            yield next(line.split()[-1] for line in lines if "http://" in line)
        finally:
            process.terminate()
            process.wait(10)


@contextmanager
def twenty_units() -> Iterator[str]:
    """Run a plant of twenty units, simulated in process; yield the address of its dashboard."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "plant.toml")
        path.write_text(twenty_file(Path(folder)), encoding="utf-8")
        with padwatch("run", str(path), "--port", "0") as (_, line):
            yield line.split()[-1]


def twenty_file(folder: Path) -> str:
    """Return a plant of twenty copies of a demo unit, sampled slowly to save time."""
    head, *units = plant_file(20, folder).split("[[unit]]\n")
    text = head.replace('"Benchmark"', '"Twenty units"') + QUICK_ANALYSIS
    for number, unit in enumerate(units, 1):
        named = re.sub(r'^name = ".*"', f'name = "Unit {number}"', unit, count=1, flags=re.M)
        slow = named.replace("rate_hz = 600.0", "rate_hz = 200.0", 1)
        source = re.sub(r"(\[unit\.source\]\n)(?:[^\[\n].*\n)+", r'\1kind = "simulated"\n', slow)
        text += f"[[unit]]\n{source}"
    return text


async def prepare(url: str) -> None:
    """Wait for the samples around an alarm, and make an account and a key."""
    account = {"name": "anna", "role": "engineer", "password": "thrust collar 17"}
    key = {"name": "historian", "role": "viewer", "days": 365}
    async with async_playwright() as playwright:
        service = await playwright.request.new_context(base_url=f"{url}api/v1/")
        await await_recording(service)
        for path, body in (("accounts", account), ("keys", key)):
            answer = await service.post(path, data=body)
            if not answer.ok:
                sys.exit(f"{path}: {await answer.text()}")


async def await_recording(service: APIRequestContext) -> None:
    """Wait for the samples around the alert and the danger; the cause is then known."""
    began_s = time.monotonic()
    while len((await (await service.get("recordings")).json())["recordings"]) < 2:
        if time.monotonic() - began_s > WAIT_S:
            sys.exit(f"no alarm within {WAIT_S:.0f} s: nothing to show")
        await asyncio.sleep(5.0)


async def take_all(url: str, looks: list[Picture]) -> None:
    """Take the given pictures."""
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))))
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=chromium)
        painter = await browser.new_page()
        for picture in looks:
            shot = await taken(browser, url, picture)
            small = indexed_png(await pixels_of(painter, shot))
            (EVERY / f"{picture.name}.png").write_bytes(small)
            if picture.name in IN_THE_GUIDE:
                (GUIDE / f"{picture.name}.png").write_bytes(small)
            print(f"{picture.name:<24}{len(small) / 1000:>7.0f} kB")
        await browser.close()


async def taken(browser: Browser, url: str, picture: Picture) -> bytes:
    """Take a picture of one page when it is completely drawn."""
    width, height = PHONE if picture.is_phone else SCREEN
    page = await browser.new_page(
        viewport={"width": width, "height": height},
        color_scheme="dark" if picture.is_dark else "light",
        extra_http_headers=ELSEWHERE if picture.is_remote else {},
    )
    await page.goto(url + picture.address)
    await page.locator(picture.until).first.wait_for(state="attached", timeout=DRAWN_MS)
    await page.wait_for_function(NOW_IS_KNOWN, timeout=DRAWN_MS)
    await page.wait_for_timeout(CHARTS_MS)
    reach = await page.evaluate("document.documentElement.scrollHeight")
    seen = {"x": 0, "y": 0, "width": width, "height": min(max(height, reach), MOST_HEIGHT)}
    shot = await page.screenshot(full_page=True, clip=seen)
    await page.close()
    return shot


async def pixels_of(painter: Page, png: bytes) -> Pixels:
    """Return red, green and blue of every pixel, as decoded by the browser."""
    width, height, text = await painter.evaluate(PIXELS, base64.b64encode(png).decode())
    values = np.frombuffer(base64.b64decode(text), dtype=np.uint8)
    return values.reshape(height, width, 4)[..., :3]


if __name__ == "__main__":
    main()
