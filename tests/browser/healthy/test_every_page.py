"""What holds for every page there is: no complaint, a title, phone width, light and dark."""

import pytest
from on_screen import (
    A_NUMBER,
    FILES,
    assert_accessible,
    assert_fits,
    await_charts,
    await_orbit,
    await_spectra,
    freeze,
    number_with,
)
from playwright.async_api import Browser, Page, expect
from rigs.tiers import first_fast

SEGMENTS = {":unit": "U1", ":bearing": "UJB"}
BEARING = "#/units/U1/bearings/UJB"

PATTERNS = f"""import('{FILES}pages.js')
    .then(({{ PAGES }}) => PAGES.map(({{ pattern }}) => pattern))"""
WAITING = "Asking the service."
BAND = "getComputedStyle(document.body).backgroundColor"
LONG_NAMES = (
    "Гидроагрегат_№12_Саяно-Шушенской_ГЭС_имени_Непорожнего_640МВт",
    "مولد الطاقة الكهرومائية رقم ١٢ في محطة السد العالي بأسوان ⚡🌊",
    "三峡水电站左岸厂房第十二号水轮发电机组上导轴承油膜刚度在线监测系统甲乙丙丁戊己庚辛壬癸子丑寅卯辰巳午未申酉",
)
ONE_DAY_BEHIND = """(() => {
  const Right = Date;
  const now = () => Right.now() - 86_400_000;
  window.Date = class extends Right {
    constructor(...parts) { super(...(parts.length ? parts : [now()])); }
    static now() { return now(); }
  };
})()"""
SHOWN_CLOCK = """() => Date.parse(
  document.querySelector("#clock").textContent.replace(/ UTC$/, "Z").replace(" ", "T")
)"""
REDRAWN = """before =>
    document.querySelector('[data-chart=spectrum] .chart path.xgrid').style.stroke !== before"""


async def addresses(page: Page, url: str) -> list[str]:
    await page.goto(url)
    patterns = await page.evaluate(PATTERNS)
    assert len(patterns) >= 4
    for segment, name in SEGMENTS.items():
        patterns = [pattern.replace(segment, name) for pattern in patterns]
    assert not any("/:" in address for address in patterns), patterns
    return patterns


async def open_settled(page: Page, address: str) -> None:
    """Open a page and wait until it has had the answers that it opens with."""
    await page.goto(address)
    await expect(page.locator("#service")).to_contain_text("Connected")
    await expect(page.locator("#main").get_by_role("heading").first).to_be_attached()
    waiting = page.locator("#main").get_by_text(WAITING).filter(visible=True)
    await expect(waiting).to_have_count(0)


async def unfold(page: Page, address: str) -> None:
    """Wait for the widest contents of a page, and open what is folded up."""
    if address in ("#/", "#/units/U1", BEARING):
        await expect(page.locator(".number").first).to_have_text(A_NUMBER)
    if address == "#/sources":
        await expect(page.locator("[data-source=U1]")).to_contain_text("Connected")
        await page.get_by_role("button", name="Details").click()
    if address == BEARING:
        await await_charts(page)
        await page.locator(".fold summary").click()
        await page.locator(".estimators button.spread:visible").first.click()
        await expect(page.locator(".estimators .budget tbody tr").first).to_be_visible()
    if address.endswith("/waterfall"):
        await await_spectra(page)
    if address.endswith("/orbits"):
        await await_orbit(page)


async def test_every_page_opens_without_a_complaint_under_its_own_title(plant, page, complaints):
    titles = set()
    pages = await addresses(page, plant.url)
    for address in pages:
        await open_settled(page, plant.url + address)
        titles.add(await page.title())
        assert complaints == [], address
    assert len(titles) == len(pages)


async def test_no_page_scrolls_sideways_on_a_phone(plant, phone_page):
    for address in await addresses(phone_page, plant.url):
        await open_settled(phone_page, plant.url + address)
        await unfold(phone_page, address)
        await assert_fits(phone_page)


@pytest.mark.long
async def test_names_of_sixty_characters_in_any_alphabet_fit_on_a_phone(plant, phone_page):
    overview = await freeze(phone_page, plant.url)
    for unit in overview["units"]:
        unit["name"] = LONG_NAMES[0]
        for bearing, name in zip(unit["bearings"], LONG_NAMES, strict=True):
            bearing["name"] = name
    for address in ("#/", "#/units/U1", BEARING):
        await open_settled(phone_page, plant.url + address)
        await expect(phone_page.locator("#main").get_by_text(LONG_NAMES[0]).first).to_be_visible()
        await assert_fits(phone_page)


async def test_a_wrong_clock_of_the_browser_changes_no_time_on_a_page(plant, browser: Browser):
    context = await browser.new_context(timezone_id="UTC")
    await context.add_init_script(ONE_DAY_BEHIND)
    page = await context.new_page()
    await open_settled(page, plant.url)
    answer = await page.request.get(f"{plant.url}api/v1/overview")
    time = answer.headers["padwatch-time"]
    behind_ms = await page.evaluate(f"time => Date.parse(time) - ({SHOWN_CLOCK})()", time)
    assert abs(behind_ms) < 3_600_000
    await context.close()


@pytest.mark.parametrize("schemes", first_fast(1, [("light", "dark"), ("dark", "light")]))
async def test_no_page_shuts_anybody_out_in_light_or_in_dark(plant, page, schemes):
    pages = await addresses(page, plant.url)
    for number, address in enumerate(pages):
        scheme = schemes[number % len(schemes)]
        await page.emulate_media(color_scheme=scheme)
        await open_settled(page, plant.url + address)
        await expect(page.locator(f"html[data-theme={scheme}]")).to_be_attached()
        await assert_accessible(page)


async def test_the_look_follows_the_system_until_somebody_chooses_and_is_remembered(plant, page):
    await page.emulate_media(color_scheme="dark")
    await page.goto(plant.url + BEARING)
    dark = await page.evaluate(BAND)
    await page.get_by_text("Settings", exact=True).click()
    await page.get_by_label("Theme").select_option("light")
    light = await page.evaluate(BAND)
    assert light != dark
    await page.reload()
    assert await page.evaluate(BAND) == light
    grid = page.locator("[data-chart=spectrum] .chart path.xgrid").first
    await expect(grid).to_be_attached()
    stroke = "node => node.style.stroke"
    drawn = await grid.evaluate(stroke)
    await page.get_by_text("Settings", exact=True).click()
    await page.get_by_label("Theme").select_option("system")
    assert await page.evaluate(BAND) == dark
    await page.wait_for_function(REDRAWN, arg=drawn)


@pytest.mark.long
async def test_amplitudes_are_shown_zero_to_peak_or_twice_that_as_chosen(plant, page):
    await page.goto(plant.url + BEARING)
    shaft = page.locator("[data-reading=order1_shaft_x_um_pk]")
    before = await number_with(shaft, "µm pk")
    await page.get_by_text("Settings", exact=True).click()
    await page.get_by_label("Amplitudes").select_option("pp")
    after = await number_with(shaft, "µm pk-pk")
    assert after / before == pytest.approx(2.0, rel=0.1)  # the machine lives on in between
    chart = page.locator("[data-chart=amplitude-trend] .ytitle")
    await expect(chart).to_have_text("Vibration amplitude, µm pk-pk")
    await page.reload()
    await expect(shaft.locator(".suffix")).to_have_text("µm pk-pk")
