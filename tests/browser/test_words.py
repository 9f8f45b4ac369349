"""Nobody at a machine should have to read a code: everything the API may say has words."""

import re
from pathlib import Path

import pytest

from core.alarms.alarm import AlarmChange, AlarmState
from core.change.cause import Cause
from core.change.decision import Verdict
from core.condition.operating_state import OperatingState
from core.machine.unit import Estimator
from core.quality import Reason
from core.spectra.runout import RunoutVerdict
from core.spectra.speed import SpeedSource
from service.settings.alarm_kinds import ALARM_KINDS

STATIC = Path(__file__).parents[2] / "service" / "dashboard" / "static"
SOURCE, FILM_WORDS = STATIC / "words.js", STATIC / "film_words.js"
ALARM_WORDS = STATIC / "alarm_words.js"
ENTRY = re.compile(r"^  (\w+): (.+),$", re.MULTILINE)
WORDS_AND_SENTENCE = re.compile(r"\[\"[^\"]{2,25}\", \"[A-Z][^\"]+[.]\"\]")
"""A few words that fit a table's cell, and a sentence for the bearing page."""


def entries(table: str, source: Path = SOURCE) -> dict[str, str]:
    body = re.search(rf"^const {table} = {{$(.*?)^}};$", source.read_text(), re.M | re.S)
    assert body is not None, f"{source.name} has no table {table}"
    return dict(ENTRY.findall(body[1]))


def test_every_reason_has_words_and_a_sentence_and_nothing_else_has():
    reasons = entries("REASONS")
    assert reasons.keys() == {reason.value for reason in Reason} | {"service_not_reachable"}
    assert [name for name, said in reasons.items() if not WORDS_AND_SENTENCE.fullmatch(said)] == []


@pytest.mark.parametrize(
    ("table", "codes"),
    [("STATES", AlarmState), ("CHANGES", AlarmChange)],
)
def test_every_code_of_an_alarm_has_words(table, codes):
    words = entries(table, ALARM_WORDS)
    assert words.keys() == {code.value for code in codes}
    assert all(4 < len(said) < 43 for said in words.values())


def test_every_kind_of_alarm_has_a_label_of_its_own_that_fits_a_table():
    labels = [kind.label for kind in ALARM_KINDS.values()]
    assert len(set(labels)) == len(labels)
    assert all(2 < len(label) < 41 and label[0].isupper() for label in labels)


@pytest.mark.parametrize(
    ("source", "table", "codes"),
    [
        (SOURCE, "ESTIMATORS", {estimator.value for estimator in Estimator}),
        (SOURCE, "RUNOUT", {verdict.value for verdict in RunoutVerdict}),
        (SOURCE, "SPEED_SOURCES", {source.value for source in SpeedSource}),
        (FILM_WORDS, "VERDICTS", {verdict.name.lower() for verdict in Verdict} | {"no_reading"}),
        (FILM_WORDS, "CAUSES", {cause.value for cause in Cause}),
        (FILM_WORDS, "STATES", {state.name.lower() for state in OperatingState}),
    ],
)
def test_every_other_code_has_words_and_no_word_is_left_over(source, table, codes):
    assert entries(table, source).keys() == codes


def test_only_a_film_that_is_normal_looks_and_is_called_so():
    good = {name for name, look in entries("VERDICTS", FILM_WORDS).items() if '"normal"' in look}
    normal = {name for name, look in entries("VERDICTS", FILM_WORDS).items() if "Normal" in look}
    assert good == normal == {"normal"}
