"""One table of alarm kinds: what names a kind elsewhere reads it there."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from core.alarms import kinds as units
from core.alarms.rules import BearingRules, UnitRules
from core.machine.unit import Bearing
from core.monitor.catalogue import CATALOGUE
from service.alarms.health import ServiceHealth
from service.alarms.service_rules import ServiceRules
from service.settings.alarm_kinds import ALARM_KINDS, SERVICE_KINDS

ROOT = Path(__file__).parents[3]
MAX_NAMED = 6
"""Kinds that one module may name because it judges them."""


def names_of(*classes: type) -> set[str]:
    return {field.name for each in classes for field in fields(each)}


def test_every_kind_names_a_rule_and_a_reading_that_exist() -> None:
    readings = {quantity.name for quantity in CATALOGUE}
    readings |= {"shaft_x", "shaft_y", "bearing_x", "bearing_y"}
    for kind in units.ALARM_KINDS.values():
        assert kind.rule in names_of(BearingRules, UnitRules), kind.name
        assert kind.reading is None or kind.reading in readings, kind.name
    for kind in SERVICE_KINDS.values():
        assert kind.rule in names_of(ServiceRules), kind.name
        assert kind.reading is None or kind.reading in names_of(ServiceHealth), kind.name
    assert len(ALARM_KINDS) == len(units.ALARM_KINDS) + len(SERVICE_KINDS)


def test_the_page_about_alarms_lists_every_kind() -> None:
    page = (ROOT / "docs" / "how-to" / "alarms.md").read_text()
    table = page.partition("| Alarm | Subject |")[2].partition("\n\n")[0]
    cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert set(re.findall(r"`(\w+)`", " ".join(cells))) == set(ALARM_KINDS)


@pytest.mark.parametrize("pattern", ["*.py", "*.js"])
def test_no_other_module_of_the_service_lists_kinds_of_alarms(pattern: str) -> None:
    other = {quantity.name for quantity in CATALOGUE} | names_of(Bearing, ServiceRules)
    wanted = "|".join(ALARM_KINDS.keys() - other)
    for path in (ROOT / "service").rglob(pattern):
        if path.name != "alarm_kinds.py":
            named = re.findall(rf"(?<!\w)({wanted})(?!\w)", path.read_text())
            assert len(set(named)) <= MAX_NAMED, path
