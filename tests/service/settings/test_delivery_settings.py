"""Receivers of alarms in the plant file."""

from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.clock import SystemClock
from service.app.notifications import receivers_of, router_of
from service.notifications.message import AlarmContext
from service.settings.loading import load_plant_file
from service.settings.storage import Origin
from service.store.outbox import no_recipients

WEBHOOK = """
[[delivery.receiver]]
kind = "webhook"
id = "desk"
url = "https://alarms.example/padwatch?key=1"
secret = { env = "PADWATCH_KEY" }
quiet = { start = "22:00", end = "06:00", time_zone = "America/Asuncion" }
units = ["U1"]
kinds = ["link_lost", "stiffness_x"]
lowest_priority = "danger"
"""

SMTP = """
[[delivery.receiver]]
kind = "smtp"
id = "shift"
host = "mail.example"
username = "padwatch"
password = { file = "/etc/padwatch/mail" }
sender = "padwatch@plant.example"
recipients = ["a@plant.example", "b@plant.example"]
"""


def test_every_recipient_is_a_receiver_and_secrets_in_addresses_are_not_shown(
    plant_text: str, tmp_path: Path
) -> None:
    path = tmp_path / "plant.toml"
    path.write_text(plant_text + WEBHOOK + SMTP, encoding="utf-8")
    plant, clock = load_plant_file(path), SystemClock()

    found = receivers_of(plant, Origin.LIVE, clock)

    assert [(one.name, one.channel.address) for one in found] == [
        ("desk", "https://alarms.example"),
        ("shift:a@plant.example", "a@plant.example"),
        ("shift:b@plant.example", "b@plant.example"),
    ]
    assert found[0].settings.quiet is not None
    midnight_utc_ns, hour_ns = 1_767_225_600_000_000_000, 3600 * 10**9  # 21:00 in Asunción
    quiet = [
        found[0].settings.quiet.include(midnight_utc_ns + hours * hour_ns)
        for hours in range(0, 24, 3)
    ]
    assert quiet == [False, True, True, False, False, False, False, False]
    # A replay tells nobody.
    assert receivers_of(plant, Origin.REPLAY, clock) == []
    assert router_of(plant, Origin.REPLAY, lambda _: AlarmContext(), clock) is no_recipients


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"https://alarms', '"ftp://alarms', "must begin with https:// or http://"),
        ('"https://alarms', '"https://me:you@alarms', "must not contain a user name or password"),
        ('"https://alarms.example/padwatch?key=1"', '"https://a.b/ü"', "must be a URL with a host"),
        ('{ env = "PADWATCH_KEY" }', '"s3cret"', "secret"),
        ('{ env = "PADWATCH_KEY" }', "{}", "exactly one of file and env"),
        ('"22:00"', '"24:00"', "delivery.receiver[1].quiet.start"),
        ('"06:00"', '"22:00"', "must differ from start"),
        ("America/Asuncion", "Mars/Olympus", "is not a known IANA time zone"),
        ('["U1"]', '["U9"]', "unknown unit; known units: U1, U2"),
        ('["link_lost", "stiffness_x"]', '["mood"]', "delivery.receiver[1].kinds[1]"),
        ('"danger"', '"panic"', "lowest_priority"),
        ('id = "shift"', 'id = "desk"', "is used twice"),
        ('username = "padwatch"\n', "", "username and password must be given"),
        ('host = "mail.example"', 'host = "mail.example"\ntls = "none"', "unencrypted"),
        ('"a@plant.example"', '"a@plant.example\\r\\nBcc: x@y.z"', "delivery.receiver[2]"),
        ('"b@plant.example"', '"a@plant.example"', "is used twice"),
    ],
)  # fmt: skip
def test_a_receiver_that_cannot_be_is_refused_by_its_place(
    old: str, new: str, words: str, plant_text: str, mistakes: Callable[[str], list[str]]
) -> None:
    text = WEBHOOK + SMTP
    assert old in text

    (said,) = mistakes(plant_text + text.replace(old, new, 1))

    assert words in said
    assert "delivery.receiver[" in said
