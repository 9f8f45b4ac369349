"""An alarm's evidence, from the running plant to the printed page."""

import re

import pytest
from playwright.async_api import expect
from real_plant import DEMO

ALARM = "U1:UJB:order1_shaft_x"
CAPTURE = "\n[capture]\npre_s = 5.0\npost_s = 2.0\nmax_s = 60.0\n"
LIMIT = "alarms.shaft_order1_um_pk = { alert = 1.0, deadband = 0.1 }\n"
OIL = 'oil_temperature = "ujb_oil_temperature"\n'


@pytest.mark.long
async def test_a_report_is_one_page_and_leads_to_a_recording(new_plant, page, complaints, tmp_path):
    example = tmp_path / "example.toml"
    text = DEMO.read_text(encoding="utf-8").replace(OIL, OIL + LIMIT, 1)
    example.write_text(text, encoding="utf-8")
    new_plant._example = example
    new_plant.settings += CAPTURE
    new_plant.start_daq()
    new_plant.start_service()
    await page.goto(f"{new_plant.url}#/alarms")
    row = page.locator(f"[data-alarm='{ALARM}']")
    await expect(row).to_be_visible()
    links = f"{new_plant.url}api/v1/alarms/{ALARM}/evidence"
    for _ in range(600):
        [listed] = (await (await page.request.get(links)).json())["occurrences"]
        if (listed["state"], listed["samples"]) == ("complete", "complete"):
            break
        await page.wait_for_timeout(200)
    assert (listed["state"], listed["samples"]) == ("complete", "complete")

    async with page.context.expect_page() as opened:
        await row.get_by_role("link", name="report").click()
    report = await opened.value
    await report.wait_for_load_state()

    await expect(report.locator("h1")).to_have_text("U1 UJB: shaft vibration 1×, x")
    assert await report.locator("figure").count() == 2
    printed = await report.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b(?!s)", printed)) == 1

    await page.goto(f"{new_plant.url}#/recordings")
    recording = page.locator("[data-recording]").first
    await expect(recording).to_contain_text("UJB: Shaft vibration 1×, x")
    await recording.get_by_role("button", name="Check").press("Enter")
    await expect(recording).to_contain_text("Checked, whole")
    await expect(page.locator(".recordings .advice").first).to_contain_text("12 channels at 600")
    reported = page.locator(f"[data-report='{ALARM} 1']")
    await expect(reported).to_contain_text("kept")
    address = await reported.get_by_role("link", name="report").get_attribute("href")
    assert (await page.request.get(f"{new_plant.url.rstrip('/')}{address}")).ok
    assert complaints == []
