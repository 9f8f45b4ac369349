"""Baselines are learned while a machine is healthy, and done to as engineers say."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from core.baseline.baseline import BearingBaseline
from core.baseline.history import StiffnessHistory
from core.change.decision import JUDGED
from core.change.film_judge import FilmJudge, FilmNews
from core.change.settings import FilmRules
from core.condition.cells import CellGrid
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Estimator, Unit
from service.live.commands import (
    Accept,
    BaselineRefusedError,
    FilmPlace,
    Freeze,
    Reject,
    Renew,
    Thaw,
)
from service.measuring.films import FilmMonitor
from service.settings.films import FilmAlarmSettings
from service.store.baselines import BaselineStep
from service.store.film_readings import FilmHistory, FilmQuery
from service.store.sqlite import SqliteStore

DAY_NS = 86_400_000_000_000
UJB = FilmPlace("U1", "UJB", Estimator.DYNAMIC)
Tell = Callable[..., list[FilmNews]]


class Plant:
    """A unit with one bearing whose days pass when told."""

    def __init__(self, store: SqliteStore, film_news: Tell, clock: Any) -> None:
        self.store, self.film_news, self.clock = store, film_news, clock

    async def start(self, **settings: Any) -> FilmMonitor:
        """A keeper as after a start."""
        given = FilmAlarmSettings(**settings)
        rules = {"U1": rules_of(given)}
        keeper = FilmMonitor({"U1": unit()}, rules, given, self.store.films, self.clock)
        await keeper.start()
        return keeper

    async def live(
        self,
        keeper: FilmMonitor,
        history: StiffnessHistory,
        days: tuple[int, int],
        every: int = 1,
        judged: bool = False,
    ) -> None:
        """Let days pass: readings are judged as the keeper does, if wanted; stored, learned."""
        judge: FilmJudge = keeper._watches["U1"].judge
        for day in range(*days, every):
            today = self.film_news(days_of(history, day, min(day + every, days[1])))
            if judged:
                today = [news for told in today for news in judge.judge([told.reading])]
            self.store.append([], [], [], today)
            now_ns = int(history.time_ns[0]) + (day + every) * DAY_NS
            self.clock.step((now_ns - self.clock.now_ns()) / 1e9)
            await keeper.learn_due()

    def history(self, **query: Any) -> FilmHistory:
        return self.store.films.history(FilmQuery("U1", "UJB", Estimator.DYNAMIC, **query))

    @property
    def versions(self) -> list[int]:
        """Newest first."""
        return [entry.version for entry in self.store.films.baselines("U1", "UJB")]


@pytest.fixture
def plant(store: SqliteStore, film_news: Tell, stepped_clock: Any) -> Plant:
    return Plant(store, film_news, stepped_clock)


def unit() -> Unit:
    channels = tuple(Channel(id_, Measurand.DISPLACEMENT_UM) for id_ in ("sx", "sy", "bx", "by"))
    bearing = Bearing("UJB", 1.18e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0), "oil")
    return Unit("U1", 92.3, 600.0, channels, (bearing,), "speed", "power")


def rules_of(settings: FilmAlarmSettings) -> FilmRules:
    operating = replace(settings.operating.limits(92.3, 330.0), warm_up_s=3600.0)
    limits = settings.change.limits()
    return FilmRules({"UJB": Estimator.DYNAMIC}, CellGrid(), operating, limits, 600 * 10**9)


def in_force(keeper: FilmMonitor) -> int | None:
    baseline = keeper.baseline("U1", "UJB")
    return baseline.origin.version if baseline else None


def days_of(history: StiffnessHistory, first: float, end: float) -> StiffnessHistory:
    day = (history.time_ns - history.time_ns[0]) / DAY_NS
    return history.where((day >= first) & (day < end))


async def test_a_baseline_is_learned_after_its_days_and_put_in_force(plant, film_life):
    keeper, history = await plant.start(learn_every_days=4), film_life(2, days=31)

    await plant.live(keeper, history, (0, 19))
    assert in_force(keeper) is None
    await plant.live(keeper, history, (19, 31), judged=True)

    versions = plant.versions
    assert versions == sorted(versions, reverse=True)
    assert in_force(keeper) == versions[0] >= 3
    newest = plant.history(newest=50)
    assert np.isin(newest.verdict, [int(v) for v in JUDGED]).any()
    assert set(newest.baseline_version.tolist()) <= {versions[0], versions[0] - 1}


@pytest.mark.long
async def test_learning_ends_with_its_period(plant, film_life):
    keeper, history = await plant.start(learning_days=30, learn_every_days=5), film_life(2, days=37)
    await plant.live(keeper, history, (0, 37))
    last = plant.store.films.baselines("U1", "UJB")[0]
    assert last.learned_until_ns <= history.time_ns[0] + 30 * DAY_NS
    assert last.learned_until_ns > history.time_ns[0] + 29 * DAY_NS


@pytest.mark.long
async def test_a_film_that_creeps_away_is_not_learned_little_by_little(plant, film_life):
    """Too slow to differ much from one fortnight's baseline to the next."""
    creep = film_life(
        2, days=90, change=lambda h: np.log(1.0 - 0.2 * np.clip((h / 24 - 20) / 70, 0.0, 1.0))
    )
    keeper = await plant.start(learn_every_days=20)
    await plant.live(keeper, creep, (0, 80), every=5)
    await plant.live(keeper, creep, (80, 90), every=5, judged=True)

    steps = plant.store.films.steps("U1", "UJB")
    doubted = {s.version for s in steps if s.step is BaselineStep.LEARNED and "%" in s.reason}
    found = plant.history()
    assert doubted
    assert in_force(keeper) == min(doubted) - 1
    assert (found.level[:2, -1] > 0).all()
    assert (found.change[:2, -1] < -0.1).all()


@pytest.mark.long
async def test_a_restart_goes_on_with_the_same_baseline_and_decisions(plant, film_life):
    history = film_life(2, days=26)
    keeper = await plant.start(learn_every_days=100)
    await plant.live(keeper, history, (0, 25), judged=True)
    before = keeper._watches["U1"].judge

    again = await plant.start(learn_every_days=100)
    after = again._watches["U1"].judge
    for told_next in plant.film_news(days_of(history, 25, 26)):
        [went_on], [through] = (judge.judge([told_next.reading]) for judge in (after, before))
        assert went_on.findings == through.findings
    assert in_force(again) == in_force(keeper) == 1


async def test_engineers_decide_where_it_is_left_to_them(plant, film_life):
    keeper = await plant.start(acceptance="by_engineer", learn_every_days=5)
    await plant.live(keeper, film_life(2, days=28), (0, 28))
    assert in_force(keeper) is None
    assert plant.versions == [2, 1]

    await keeper.act(UJB, Accept(2), "Ada", "compared with last year")
    assert in_force(keeper) == 2
    with pytest.raises(BaselineRefusedError, match="version 2 is already in force"):
        await keeper.act(UJB, Accept(2), "Ada", "again")
    with pytest.raises(BaselineRefusedError, match="version 7 does not exist"):
        await keeper.act(UJB, Accept(7), "Ada", "a guess")
    await keeper.act(UJB, Reject(2), "Bo", "the oil sensor was wrong")
    assert in_force(keeper) is None
    await keeper.act(UJB, Accept(1), "Bo", "of before")
    assert in_force(keeper) == 1
    steps = plant.store.films.steps("U1", "UJB")
    assert [(s.step, s.version, s.actor) for s in steps] == [
        (BaselineStep.LEARNED, 1, "padwatch"),
        (BaselineStep.LEARNED, 2, "padwatch"),
        (BaselineStep.ACCEPTED, 2, "Ada"),
        (BaselineStep.WITHDRAWN, 2, "Bo"),
        (BaselineStep.ACCEPTED, 1, "Bo"),
    ]


async def test_what_is_frozen_is_learned_no_further_until_it_is_thawed(plant, film_life):
    keeper, history = await plant.start(learn_every_days=5), film_life(2, days=45)
    with pytest.raises(BaselineRefusedError, match="no baseline in force"):
        await keeper.act(UJB, Freeze(), "Ada", "too early")
    await plant.live(keeper, history, (0, 22))
    await keeper.act(UJB, Freeze(), "Ada", "enough")
    await plant.live(keeper, history, (22, 35))
    assert len(plant.versions) == 1
    with pytest.raises(BaselineRefusedError, match="already frozen"):
        await keeper.act(UJB, Freeze(), "Ada", "again")
    await keeper.act(UJB, Thaw(), "Ada", "winter is missing")
    await plant.live(keeper, history, (35, 37))
    assert in_force(keeper) == 2


async def test_an_overhaul_begins_everything_again(plant, film_life):
    keeper, history = await plant.start(), film_life(2, days=60)
    await plant.live(keeper, history, (0, 25))
    assert in_force(keeper) == 1
    with pytest.raises(BaselineRefusedError, match="future"):
        await keeper.act(UJB, Renew(plant.clock.now_ns() + 1), "Ada", "overhaul next week")

    await keeper.act(UJB, Renew(plant.clock.now_ns()), "Ada", "new pads")
    assert in_force(keeper) is None
    with pytest.raises(BaselineRefusedError, match="older than the last machine event"):
        await keeper.act(UJB, Accept(1), "Ada", "the old one")
    event_ns = plant.clock.now_ns()
    await plant.live(keeper, history, (25, 50))

    baseline: BearingBaseline | None = keeper.baseline("U1", "UJB")
    assert baseline is not None
    assert baseline.learned_from_ns >= event_ns


async def test_readings_in_a_wrong_unit_are_mentioned_and_change_nothing(plant, film_life):
    keeper, history = await plant.start(), film_life(2, days=25)
    ln_k = history.ln_k.copy()
    ln_k[0, 500:600] += np.log(1000.0)
    await plant.live(keeper, replace(history, ln_k=ln_k), (0, 22))
    assert in_force(keeper) == 1
    learned = plant.store.films.steps("U1", "UJB")[0]
    assert learned.step is BaselineStep.LEARNED
    assert "readings in x are at least twice or at most half the baseline" in learned.reason
