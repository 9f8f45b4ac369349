"""Single modules of the dashboard, run in the browser without a page of the plant."""

from on_screen import FILES
from playwright.async_api import Page

EMPTY = FILES[1:] + "padwatch.svg"
"""A page of the plant that runs nothing by itself."""

CALL = f"""
async ([module, name, ...given]) => (await import(`{FILES}${{module}}.js`))[name](...given)
"""

DRAWN_WITHOUT_A_SIZE = """async (files) => {
  const { orbitPicture } = await import(`${files}charts/orbit_picture.js`);
  const trace = [1, 2, 3];
  const clip = {
    startS: 0, rate_hz: 1, n_samples: 3, turnS: 1, mark: [], order1: null,
    shaft_x_um: trace, shaft_y_um: trace, clearance_um: 100, centre_um: [0, 0],
  };
  orbitPicture().draw(clip, 2, { turns: 1, whole: true, alone: false, inClearance: true });
}"""

CONNECTED = {"state": "connected", "reason": None, "data_age_s": 0.2}
DRIFT = {"kind": "clock_drift", "level": "alert", "is_active": True, "value": 300.0}
DRIFT |= {"limit": 200.0, "value_unit": "ppm"}
SILENT = {"state": "not_connected", "reason": "daq:502: no reply within 0.5 s"}
OTHER = SILENT | {"reason": "daq:502: wrong device: vendor is 'A', expected 'B'"}
NAMELESS = SILENT | {"reason": "daq:502: no name server answered within 1.0 s"}
UNKNOWN = SILENT | {"reason": "daq:502: [Errno -3] Temporary failure in name resolution"}


async def test_an_alarm_leads_to_where_most_is_told_about_it(plant, page: Page) -> None:
    await page.goto(plant.url + EMPTY)
    bearing = ("order1_shaft_x", "zone_bearing_y", "oil_temperature", "gap_x", "opposite_gap_y")
    alarms = [("stiffness_x", "UJB"), ("channel_not_ok", "a"), ("link_lost", "link")]
    alarms += [(kind, "UJB") for kind in bearing]
    told = [{"unit": "U1", "subject": subject, "kind": kind} for kind, subject in alarms]
    found = [await page.evaluate(CALL, ["alarm_place", "alarmPlace", alarm]) for alarm in told]
    place = "#/units/U1/bearings/UJB"
    assert found == [f"{place}/film", "#/units/U1", "#/sources", *([place] * len(bearing))]
    at = {"operating_state": "full_load", "eccentricity_ratio": 0.37, "attitude_deg": None}
    raised = {"raised_at": at | {"oil_temperature_c": 46.2}}
    words = await page.evaluate(CALL, ["alarm_words", "raisedWords", raised])
    assert words == "full load, eccentricity 0.37, oil 46.2 °C"


async def test_before_and_after_are_told_in_words_and_a_broken_chain_is_seen(plant, page) -> None:
    await page.goto(plant.url + EMPTY)
    shelved = {
        "action": "alarm.shelved",
        "object": "U1:UJB:order1_shaft_x",
        "before": {"state": "unacknowledged", "level": "alert"},
        "after": {"state": "shelved", "level": "alert", "until_ns": None},
    }
    where = await page.evaluate(CALL, ["audit_words", "objectWords", shelved])
    assert where == "U1 UJB: Shaft vibration 1×, x"
    changes = await page.evaluate(CALL, ["audit_words", "changeLines", shelved])
    assert changes == ["state: unacknowledged → shelved"]
    chain = [
        {"number": 3, "hash": "c", "previous_hash": "b"},
        {"number": 2, "hash": "b", "previous_hash": "a"},
        {"number": 1, "hash": "a", "previous_hash": "0"},
    ]
    broken = [chain[0], chain[1] | {"hash": "x"}, chain[2]]
    for entries, look in ((chain, "good"), ([chain[0], chain[2]], "absent"), (broken, "bad")):
        found = await page.evaluate(CALL, ["audit_words", "chainWords", entries])
        assert found["look"] == look


async def test_the_worst_about_a_source_is_told_with_what_to_do(plant, page) -> None:
    await page.goto(plant.url + EMPTY)
    for changes, alarms, lost, rank, look, said in [
        (NAMELESS, [], 0, 0, "bad", "name of the device"),
        (UNKNOWN, [], 0, 0, "bad", "name of the device"),
        (SILENT, [], 0, 0, "bad", "switched on"),
        (OTHER, [], 0, 0, "bad", "Another device"),
        ({"data_age_s": 12.0}, [DRIFT], 0, 1, "bad", "still samples"),
        ({"state": "unknown"}, [], 0, 1, "bad", ""),
        ({"state": "connecting"}, [], 0, 2, "uncertain", "Wait"),
        ({}, [DRIFT], 700, 3, "uncertain", "sampling rate"),
        ({}, [], 700, 4, "uncertain", "network"),
        ({"state": "ended"}, [], 0, 5, "absent", ""),
        ({}, [], 0, 9, "good", ""),
    ]:
        found = await page.evaluate(
            CALL, ["source_words", "troubleOf", CONNECTED | changes, alarms, lost]
        )
        assert (found["rank"], found["look"]) == (rank, look), found
        assert said in found["advice"]


async def test_an_orbit_may_be_drawn_before_its_place_on_the_page_has_a_size(plant, page) -> None:
    await page.goto(plant.url)
    await page.evaluate(DRAWN_WITHOUT_A_SIZE, FILES)
