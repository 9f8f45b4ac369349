"""Alarms, films and deliveries are counted under the right words."""

from collections.abc import Iterable
from typing import Any

from prometheus_client import Metric

from core.alarms.operation import Shelve
from core.alarms.rules import UnitRules
from core.alarms.unit_alarms import UnitAlarms
from core.change.decision import Verdict
from core.change.film_judge import FilmFinding, FilmNews
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.metrics import alarm_metrics, film_metrics
from service.notifications.metrics import delivery_metrics
from service.notifications.sender import Receiver, ReceiverView, SenderStatus
from service.store.outbox import Backlog

HOUR_NS = 3_600_000_000_000
NOW_NS = 1_000 * HOUR_NS


def of(metrics: Iterable[Metric], name: str) -> dict[tuple[str, ...], float]:
    """What is not zero, by values of labels."""
    return {
        tuple(sample.labels.values()): sample.value
        for family in metrics
        for sample in family.samples
        if sample.name == f"padwatch_{name}" and sample.value
    }


def unit_named(name: str) -> Unit:
    channels = tuple(Channel(id_, Measurand.DISPLACEMENT_UM) for id_ in ("sx", "sy", "bx", "by"))
    bearing = Bearing("UJB", 1.18e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0))
    return Unit(name, 60.0, 100.0, channels, (bearing,))


def test_an_alarm_counts_while_it_is_active_and_not_hidden(stepped_clock: Any) -> None:
    boards = {name: UnitAlarms(unit_named(name), UnitRules()) for name in ("U1", "U2", "U9")}
    engine = AlarmEngine(boards, lambda _: None, stepped_clock)
    units = ("U1", "U2")  # U9 is in the plant file no longer

    assert of(alarm_metrics(engine, units), "alarms_active") == {}

    for name in ("U1", "U9"):
        engine.link(name, is_connected=False, reason="nobody answers")
    stepped_clock.step(60.0)
    engine.tick()
    found = of(alarm_metrics(engine, units), "alarms_active")
    assert found == {("U1", "alert"): 1.0, ("plant", "alert"): 1.0}
    assert of(alarm_metrics(engine, units), "alarms_unacknowledged") == {(): 2.0}

    engine.operate(
        "U1:link:link_lost", Shelve("Ada", "new switch", stepped_clock.now_ns() + HOUR_NS)
    )
    found = of(alarm_metrics(engine, units), "alarms_active")
    assert found == {("plant", "alert"): 1.0}
    assert of(alarm_metrics(engine, units), "alarms_hidden") == {(): 1.0}


def test_films_count_under_the_word_that_was_said_last() -> None:
    def said(*verdicts: Verdict) -> FilmNews:
        x, y = (FilmFinding(verdict) for verdict in verdicts)
        reading: Any = None
        decisions: Any = ()
        return FilmNews(reading, (x, y), decisions)

    newest = {
        ("U1", "UJB"): said(Verdict.NORMAL, Verdict.DANGER),
        ("U1", "LJB"): said(Verdict.NORMAL, Verdict.NO_BASELINE),
    }
    bearings = {"U1": ["UJB", "LJB"], "U2": ["UJB"]}

    found = list(film_metrics(lambda unit, bearing: newest.get((unit, bearing)), bearings))

    assert of(found, "films") == {
        ("U1", "normal"): 2.0,
        ("U1", "danger"): 1.0,
        ("U1", "no_baseline"): 1.0,
    }
    assert len(found[0].samples) == len(bearings) * len(Verdict)  # every word, from the start on


def test_recipients_of_one_mail_are_added_up_and_never_named() -> None:
    """Two recipients of one mail, and a webhook that is in the plant file no longer."""
    channel: Any = None
    settings: Any = None

    def view(name: str, n_waiting: int, hours: int | None, n_dead: int) -> ReceiverView:
        oldest_ns = None if hours is None else NOW_NS - hours * HOUR_NS
        return ReceiverView(
            name,
            Receiver(name, settings, channel),
            SenderStatus(n_failures=n_waiting),
            Backlog(name, n_waiting, oldest_ns, n_dead, None, None),
        )

    gone = ReceiverView("old-hook", None, None, Backlog("old-hook", 9, 0, 9, None, None))
    views = [
        view("shift:a@plant.example", 2, 3, 1),
        view("shift:b@plant.example", 0, None, 4),
        gone,
    ]
    found = list(delivery_metrics(views, NOW_NS))

    assert of(found, "delivery_waiting_messages") == {("shift",): 2.0}
    assert of(found, "delivery_dead_messages") == {("shift",): 5.0}
    assert of(found, "delivery_failed_attempts") == {("shift",): 2.0}
    assert of(found, "delivery_wait_seconds") == {("shift",): 3 * 3600.0}
    assert "@" not in str(found)
