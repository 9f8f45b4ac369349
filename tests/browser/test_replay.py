"""Pages of a recording that has been played to its end."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.async_api import expect
from real_plant import PADWATCH, read_line, stop

RECORDINGS = Path(__file__).parents[1] / "recordings"
STIFFNESS = "[data-chart=trend-film-stiffness-gn-m]"


@pytest.fixture(scope="module")
def replayed(chromium: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:  # noqa: ARG001
    """Address of the pages of a minute at part load, recorded on 1 January 2026."""
    plant, folder = RECORDINGS / "plant.toml", tmp_path_factory.mktemp("replayed")
    asked = ["replay", str(RECORDINGS / "part_load"), "--plant", str(plant), "--speed", "0"]
    program = [*PADWATCH, *asked, "--serve", "--out", str(folder / "results")]
    with subprocess.Popen(
        program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=sys.stderr, text=True
    ) as process:
        url, is_over = "", False
        while not (url and is_over):
            line = read_line(process)
            url = line.split()[-1] if "http://" in line else url
            is_over |= "finished" in line
        yield url
        stop(process)


async def test_the_result_of_a_replay_stays_and_its_trends_are_those_of_the_recording(
    replayed, page, complaints
):
    await page.goto(replayed + "#/units/U1/bearings/UJB")
    stiffness = page.locator("[data-reading=stiffness_xx_n_per_m] .number").first
    await expect(stiffness).to_have_text("0.686")
    await expect(page.locator(".fold .source")).to_contain_text("Replay finished at")
    curve = page.locator("[data-chart=stiffness-trend] .chart path.js-line").first
    await expect(curve).to_be_attached()

    await page.goto(replayed + "#/trends")

    await expect(page.locator(f"{STIFFNESS} .chart path.js-line").first).to_be_attached()
    assert "from=2026-01-01T00%3A00%3A06" in await page.evaluate("location.hash")
    assert "to=2026-01-01T00%3A00%3A59" in await page.evaluate("location.hash")
    assert complaints == []
