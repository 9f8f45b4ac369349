"""`Watch`: a client that never stops asking, and remembers what it was shown.

What it was shown as stored must be there for ever. What it was shown as current and good must be so
in truth: the seconds for which it was not are *silent-healthy seconds*.
"""

import threading
import time
from collections import defaultdict
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from harness.ledger_daq import Offered
from harness.ledger_plant import LedgerPlant
from harness.lives import NS_PER_S
from harness.service_rig import PATIENCE_S, UNREACHABLE, Api, RefusedError
from harness.truth import BEARINGS, Spell, Truth

PERIOD_S = 0.1
TREND_S = 8.0
"""How far back a client looks at trends; longer than the newest that it can have missed."""

ON_ITS_WAY_NS = NS_PER_S
"""How long an answer may take that was right when it was given, on a machine that is busy."""

POLL_S = 0.5


@dataclass(frozen=True)
class Look:
    """One bearing as it was shown.

    Parameters
    ----------
    at_ns
        When the answer had come, by the host's clock.
    result_ns
        End of the samples of the result that was shown.
    is_good
        Whether it was shown without any reserve; it was shown as current anyhow, with values.
    """

    at_ns: int
    unit: str
    bearing: str
    result_ns: int
    is_good: bool


class Watch:
    """Asks one service after the other, again and again, in a thread."""

    def __init__(self, plant: LedgerPlant, period_s: float = PERIOD_S) -> None:
        self._plant, self._period_s = plant, period_s
        self.shown: dict[tuple[str, str], dict[int, float | None]] = defaultdict(dict)
        self.events: set[tuple[str, int]] = set()
        self.promised: set[tuple[str, str, int]] = set()
        self.looks: list[Look] = []
        self.n_answers = 0
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    def begin(self, url: str) -> None:
        """Ask this service from now on."""
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(Api(url, 5.0), self._stopped))
        self._thread.start()

    def wait_for_result(self, within_s: float = PATIENCE_S) -> None:
        """Wait until a result has been shown as stored that had not been shown before."""
        n_before, end_s = self.n_shown, time.monotonic() + within_s
        while self.n_shown == n_before and time.monotonic() < end_s:
            time.sleep(0.02)

    @property
    def n_shown(self) -> int:
        """Number of results that were shown as stored."""
        return sum(len(values) for values in list(self.shown.values()))

    def end(self) -> None:
        """Ask no more; call it before or after the service has been ended."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self, api: Api, stopped: threading.Event) -> None:
        number = 0
        with api:
            while not stopped.wait(self._period_s):
                try:
                    self._ask(api, number)
                    self.n_answers += 1
                except (*UNREACHABLE, RefusedError):
                    continue  # it was killed, or is busy: nothing was shown
                number += 1

    def _ask(self, api: Api, number: int) -> None:
        asked_ns = time.time_ns()
        overview = api.get("/api/v1/overview")
        self._look(overview, max(asked_ns, time.time_ns() - ON_ITS_WAY_NS))
        units = self._plant.units
        unit, bearing = units[number % len(units)], BEARINGS[number // len(units) % len(BEARINGS)]
        self._note_trend(unit, bearing, api)
        for event in api.get("/api/v1/alarms/events?limit=50")["events"]:
            self.events.add((event["alarm"], event["number"]))

    def _look(self, overview: dict[str, Any], at_ns: int) -> None:
        for unit in overview["units"]:
            for bearing in unit["bearings"]:
                if any(one["value"] is not None for one in bearing["readings"].values()):
                    time_ns = round(datetime.fromisoformat(bearing["time"]).timestamp() * NS_PER_S)
                    good = bearing["quality"]["level"] == "good"
                    self.looks.append(Look(at_ns, unit["id"], bearing["bearing"], time_ns, good))

    def _note_trend(self, unit: str, bearing: str, api: Api) -> None:
        now_s = time.time()
        start, end = (
            f"{datetime.fromtimestamp(at).astimezone().isoformat()}".replace("+00:00", "Z")
            for at in (now_s - TREND_S, now_s + 5.0)
        )
        found = api.get(
            f"/api/v1/units/{unit}/bearings/{bearing}/trends?quantity=order1_shaft_x_um_pk"
            f"&start={start}&end={end}&max_points=1000"
        )
        for stamp, value in zip(
            found["time"], found["series"]["order1_shaft_x_um_pk"]["mean"], strict=True
        ):
            time_ms = round(datetime.fromisoformat(stamp).timestamp() * 1000)
            self.shown[unit, bearing][time_ms] = value


def silent_healthy_s(plant: LedgerPlant, offered: Offered, looks: list[Look]) -> float:
    """For how long anything was shown as current and good that in truth was absent or faulty.

    Counted from the time on by which it must have been noticed: two and a half refreshes for
    results that do not come, the first whole block for a probe that is lost.
    """
    total_s = 0.0
    last_ns: dict[tuple[str, str], int] = {}
    for look in sorted(looks, key=lambda one: one.at_ns):
        key = (look.unit, look.bearing)
        since_ns = look.at_ns - last_ns.get(key, look.at_ns)
        last_ns[key] = look.at_ns
        if _is_wrong(plant, offered, look):
            total_s += min(max(since_ns / NS_PER_S, PERIOD_S), 1.0)
            age_ns = look.at_ns - offered.offered_ns(look.unit, _stop(plant, offered, look))
            print(f"{look}: {age_ns / NS_PER_S:.2f} s old, at most {detect_s(plant):.2f}")
    return total_s


def _stop(plant: LedgerPlant, offered: Offered, look: Look) -> int:
    return round((look.result_ns - offered.t0_ns) * plant.rate_hz / NS_PER_S)


def _is_wrong(plant: LedgerPlant, offered: Offered, look: Look) -> bool:
    stop = _stop(plant, offered, look)
    # by when it was offered: a DAQ that had no time is not the service's fault
    if (look.at_ns - offered.offered_ns(look.unit, stop)) / NS_PER_S > detect_s(plant):
        return True
    truth = Truth(plant.seed, plant.units.index(look.unit) + 1, plant.rate_hz)
    bearing = BEARINGS.index(look.bearing)
    begin = max(0, stop - plant.segment_samples)
    return look.is_good and any(
        spell.kind == "lost" and spell.bearing == bearing and _has_block(plant, spell, begin, stop)
        for spell in truth.spells(begin, stop)
    )


def _has_block(plant: LedgerPlant, spell: Spell, begin: int, stop: int) -> bool:
    """Whether a whole block was lost: a probe is judged by the mean voltage of each block.

    At the edge of a result part of a block may be lost unseen, where the window weighs next to
    nothing: 0.01 % of the amplitude with segments of 8,192 samples and blocks of 60.
    """
    first = -(-max(spell.start, begin) // plant.slot_samples) * plant.slot_samples
    return first + plant.slot_samples <= min(spell.stop, stop)


def detect_s(plant: LedgerPlant) -> float:
    """Longest age of the samples of what is shown as current: its staleness and its way."""
    return 2.5 * plant.refresh_s + plant.refresh_s + 2 * POLL_S + 1.0
