"""Any sequence of conditions, people and restarts, against a model that only keeps lists."""

import os
from dataclasses import replace

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from core.alarms.alarm import ANNOUNCED, Alarm, AlarmEvent, AlarmIdentity, AlarmRule, AlarmState
from core.alarms.life_cycle import interrupted, restored, update
from core.alarms.operation import (
    Acknowledge,
    ActionRefusedError,
    Comment,
    ReturnToService,
    Shelve,
    TakeOutOfService,
    Unshelve,
    expire,
    operate,
)
from core.limits import AlarmLevel, Judgement, unknown

IDENTITY = AlarmIdentity("U1", "UJB", "order1_shaft_x")

LEVELS = st.sampled_from([None, AlarmLevel.ALERT, AlarmLevel.DANGER])
STEPS = st.integers(0, 7)
DELAYS = st.sampled_from([0, 3, 10])


class LevelByHistory:
    """Whether one level counts, read off everything that was ever seen of it."""

    def __init__(self, level: AlarmLevel, on_delay: int, off_delay: int) -> None:
        self._level, self._delays = level, {True: on_delay, False: off_delay}
        self.counts = False
        self._seen: list[tuple[int, bool | None]] = []

    def see(self, now: int, level: AlarmLevel | None, *, known: bool) -> None:
        wanted = (level or 0) >= self._level if known else None
        self._seen.append((now, wanted))
        against = [i for i, (_, says) in enumerate(self._seen) if says == (not self.counts)]
        if wanted is None or wanted == self.counts:
            if wanted is not None:
                self._seen = []
            return
        spans = zip(self._seen, self._seen[1:], strict=False)
        lasted = sum(b - a for (a, x), (b, y) in spans if x is not None and y is not None)
        if against and lasted >= self._delays[wanted]:
            self.counts = wanted
            self._seen = []

    def restart(self) -> None:
        self._seen = []


class LifeCycle(RuleBasedStateMachine):
    """One alarm, its operator and its service."""

    def __init__(self) -> None:
        super().__init__()
        self.alarm = Alarm(IDENTITY)
        self.events: list[AlarmEvent] = []
        self.now = 0
        self.list_as_seen = 0

    @initialize(on=DELAYS, off=DELAYS)
    def begin(self, on: int, off: int) -> None:
        self.rule = AlarmRule(on, off)
        self.levels = [LevelByHistory(level, on, off) for level in AlarmLevel]
        self.model_level: AlarmLevel | None = None
        self.n_occurrences = 0
        self.open: set[int] = set()
        self.hidden: dict[str, int | None] = {}

    @rule(level=LEVELS, step=STEPS, suppressed=st.sampled_from([None, None, "standstill"]))
    def judged(self, level: AlarmLevel | None, step: int, suppressed: str | None) -> None:
        self.now += step
        self._hide_by_design(suppressed)
        self._advance(Judgement(level, suppressed_by=suppressed))
        self._model_sees(level, known=True)
        self._show_by_design(suppressed)

    @rule(step=STEPS, suppressed=st.sampled_from([None, None, "standstill"]))
    def not_judged(self, step: int, suppressed: str | None) -> None:
        self.now += step
        before = self.alarm
        self._hide_by_design(suppressed)
        self._advance(unknown("sensor_failure", suppressed))
        self._model_sees(None, known=False)
        self._show_by_design(suppressed)
        assert self.alarm.level == before.level
        assert self.alarm.occurrence == before.occurrence

    @rule()
    def samples_are_missing(self) -> None:
        self.alarm = interrupted(self.alarm)
        self._model_sees(None, known=False)

    @rule()
    def the_operator_looks_at_the_list(self) -> None:
        self.list_as_seen = self.alarm.occurrence

    @rule(looks=st.booleans())
    def the_operator_acknowledges_what_was_on_the_list(self, looks: bool) -> None:
        newest = self.alarm.occurrence
        self.list_as_seen = newest if looks else self.list_as_seen
        try:
            self._operate(Acknowledge("A. Name", self.list_as_seen))
        except ActionRefusedError:
            assert self.list_as_seen != newest
        else:
            assert self.list_as_seen == newest
            self.open.clear()

    @rule()
    def somebody_comments(self) -> None:
        before = self.alarm
        self._operate(Comment("A. Name", "told the shift engineer"))
        assert self.alarm == replace(before, n_events=before.n_events + 1)

    @rule(duration=st.integers(1, 20))
    def the_operator_shelves(self, duration: int) -> None:
        self._operate(Shelve("A. Name", "probe is being changed", self.now + duration))
        self.hidden["shelf"] = self.now + duration

    @precondition(lambda self: "shelf" in self.hidden)
    @rule()
    def the_operator_unshelves(self) -> None:
        self._operate(Unshelve("A. Name"))
        self._show("shelf")

    @rule(step=STEPS)
    def the_host_looks_at_its_clock(self, step: int) -> None:
        self.now += step
        self.alarm, events = expire(self.alarm, self.now)
        self.events += events
        if self.hidden.get("shelf", self.now + 1) <= self.now:  # type: ignore[operator]
            self._show("shelf")

    @rule()
    def maintenance_begins(self) -> None:
        self._operate(TakeOutOfService("B. Name", "overhaul"))
        self.hidden["outage"] = None

    @precondition(lambda self: "outage" in self.hidden)
    @rule()
    def maintenance_ends(self) -> None:
        self._operate(ReturnToService("B. Name"))
        self._show("outage")

    @rule()
    def the_service_restarts(self) -> None:
        before = self.alarm
        self.alarm = restored(replace(self.alarm))
        for level in self.levels:
            level.restart()
        self._advance(unknown("restarted", before.suppressed_by))
        assert (self.alarm.level, self.alarm.state) == (before.level, before.state)

    @invariant()
    def the_level_is_that_of_the_history(self) -> None:
        assert self.alarm.level == self.model_level

    @invariant()
    def every_occurrence_is_announced_once(self) -> None:
        announced = [e.occurrence for e in self.events if e.change in ANNOUNCED]
        assert announced == list(range(1, self.n_occurrences + 1))
        assert self.alarm.occurrence == self.n_occurrences

    @invariant()
    def nothing_that_nobody_has_seen_leaves_the_list(self) -> None:
        if self.hidden:
            return
        seen = {
            AlarmState.NORMAL: (False, False),
            AlarmState.RETURNED_UNACKNOWLEDGED: (False, True),
            AlarmState.ACKNOWLEDGED: (True, False),
            AlarmState.UNACKNOWLEDGED: (True, True),
        }
        assert seen[self.alarm.state] == (self.model_level is not None, bool(self.open))

    @invariant()
    def what_is_hidden_says_by_what(self) -> None:
        for reason, state in (
            ("outage", AlarmState.OUT_OF_SERVICE),
            ("shelf", AlarmState.SHELVED),
            ("design", AlarmState.SUPPRESSED),
        ):
            if reason in self.hidden:
                assert self.alarm.state is state
                return

    @invariant()
    def no_state_changes_without_an_event(self) -> None:
        assert [e.number for e in self.events] == list(range(1, len(self.events) + 1))
        states = [AlarmState.NORMAL, *(e.state_after for e in self.events)]
        assert [e.state_before for e in self.events] == states[:-1]
        assert self.alarm.state is states[-1]

    def _advance(self, condition: Judgement) -> None:
        self.alarm, events = update(self.alarm, condition, self.now, self.rule)
        self.events += events

    def _operate(self, action: object) -> None:
        self.alarm, events = operate(self.alarm, action, self.now)  # type: ignore[arg-type]
        self.events += events

    def _model_sees(self, level: AlarmLevel | None, *, known: bool) -> None:
        for each in self.levels:
            each.see(self.now, level, known=known)
        counting = [n for n, each in zip(AlarmLevel, self.levels, strict=True) if each.counts]
        now = max(counting, default=None)
        if (now or 0) > (self.model_level or 0):
            self.n_occurrences += 1
            self.open.add(self.n_occurrences)
        self.model_level = now

    def _hide_by_design(self, suppressed: str | None) -> None:
        if suppressed is not None:
            self.hidden["design"] = None

    def _show_by_design(self, suppressed: str | None) -> None:
        if suppressed is None and "design" in self.hidden:
            self._show("design")

    def _show(self, reason: str) -> None:
        """What comes back active must be seen again."""
        del self.hidden[reason]
        if self.model_level is not None:
            self.open.add(self.n_occurrences)


N_SEQUENCES = int(os.environ.get("PADWATCH_SEQUENCES", "150"))
LifeCycle.TestCase.settings = settings(
    max_examples=N_SEQUENCES, stateful_step_count=40, deadline=None
)
TestLifeCycle = LifeCycle.TestCase


@pytest.mark.long
class TestLongLifeCycle(LifeCycle.TestCase):
    """The same with more sequences."""

    settings = settings(max_examples=3 * N_SEQUENCES, stateful_step_count=40, deadline=None)
