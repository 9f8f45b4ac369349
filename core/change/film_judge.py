"""`FilmJudge`: what the readings of a unit's films say, compared with their baselines."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from core.baseline.baseline import BearingBaseline, Watched
from core.baseline.response import Place, ShaftResponse
from core.baseline.stiffness_history import DIRECTIONS
from core.change.decision import UNDECIDED, Decision, advance
from core.change.film_finding import FilmFinding, film_finding
from core.change.film_memory import PlaceDecision
from core.change.film_reading import FilmReading
from core.change.film_rules import FilmRules
from core.change.reading import WatchedReading
from core.change.recent_readings import RecentReadings
from core.condition.cells import FilmConditions


@dataclass(frozen=True)
class FilmNews:
    """A reading, what is said of it in each direction, and from where decisions go on."""

    reading: FilmReading
    findings: tuple[FilmFinding, FilmFinding]
    decisions: tuple[Decision, Decision]


class FilmJudge:
    """Holds the baselines in force and the decisions so far.

    Parameters
    ----------
    brackets_n_per_m
        Stiffness of the bracket of every bearing.
    """

    def __init__(self, rules: FilmRules, brackets_n_per_m: Mapping[str, float]) -> None:
        self._rules = rules
        self._baselines: dict[str, BearingBaseline] = {}
        self._decisions: dict[Place, Decision] = {}
        self._response: ShaftResponse | None = None
        self._recent = RecentReadings({id_: brackets_n_per_m[id_] for id_ in rules.estimators})

    def baseline(self, bearing: str) -> BearingBaseline | None:
        """What a bearing is compared with now."""
        return self._baselines.get(bearing)

    def put_in_force(
        self, bearing: str, baseline: BearingBaseline | None, decisions: Sequence[Decision] = ()
    ) -> None:
        """Compare a bearing with another baseline from its next reading on.

        Parameters
        ----------
        decisions
            Where its decisions go on, x and y; without them they begin again.
        """
        if baseline is None:
            self._baselines.pop(bearing, None)
        else:
            self._baselines[bearing] = baseline
        for direction, decision in zip(DIRECTIONS, decisions or (UNDECIDED,) * 2, strict=True):
            # of another clock, or of readings that were taken in before
            timeless = replace(decision, last_ns=None, last_counted_ns=None)
            self._decisions[bearing, direction] = timeless

    @property
    def decided(self) -> tuple[PlaceDecision, ...]:
        """All decisions so far, with what they were taken by."""
        return tuple(
            PlaceDecision(bearing, direction, self._version(bearing), decision)
            for (bearing, direction), decision in self._decisions.items()
        )

    def resume(self, decided: Sequence[PlaceDecision]) -> None:
        """Take decisions over that were taken by the same baselines."""
        for found in decided:
            if found.version == self._version(found.bearing):
                self._decisions[found.bearing, found.direction] = found.decision

    def _version(self, bearing: str) -> int | None:
        baseline = self._baselines.get(bearing)
        return baseline.origin.version if baseline else None

    def answer_by(self, response: ShaftResponse | None) -> None:
        """Put changes down to film or transducer by this response of the shaft."""
        self._response = response

    def forget_times(self) -> None:
        """Let what has been decided stand, and readings follow at any time."""
        for place, decision in self._decisions.items():
            self._decisions[place] = replace(decision, last_ns=None, last_counted_ns=None)

    @property
    def recent(self) -> RecentReadings:
        """The newest readings of all places, which tell what changed a film."""
        return self._recent

    def judge(self, readings: Sequence[FilmReading]) -> list[FilmNews]:
        """Say what readings of one moment mean, those of all bearings together."""
        found = {
            (reading.bearing, direction): self._decide(reading, direction)
            for reading in readings
            for direction in DIRECTIONS
        }
        deviations = {place: finding.deviation for place, finding in found.items()}
        self._recent.add(readings, deviations, dict(self._rises(readings)))
        return [self._news(reading, found) for reading in readings]

    def _rises(self, readings: Sequence[FilmReading]) -> Iterator[tuple[Place, float]]:
        """Rise of the baseline with eccentricity at each place that has one."""
        for reading in readings:
            baseline = self._baselines.get(reading.bearing)
            here = FilmConditions.one(
                reading.eccentricity_ratio, reading.oil_temperature_c, reading.attitude_deg
            )
            for learned in baseline.quantities if baseline else ():
                if learned.quantity is Watched.STIFFNESS:
                    rise = float(learned.eccentricity_rise(here)[0])
                    yield (reading.bearing, learned.direction), rise

    def _news(self, reading: FilmReading, found: Mapping[Place, FilmFinding]) -> FilmNews:
        places = [(reading.bearing, direction) for direction in DIRECTIONS]
        x, y = (self._attributed(place, found[place]) for place in places)
        decision_x, decision_y = (self._decisions[place] for place in places)
        return FilmNews(reading, (x, y), (decision_x, decision_y))

    def _attributed(self, place: Place, finding: FilmFinding) -> FilmFinding:
        if finding.level is None:
            return finding
        return replace(finding, attribution=self._recent.attribution(place, self._response))

    def _decide(self, reading: FilmReading, direction: str) -> FilmFinding:
        place = (reading.bearing, direction)
        value = reading.values[DIRECTIONS.index(direction)]
        watched = WatchedReading(
            self._rules.lapsed_ns(reading.time_ns),
            reading.condition.is_settled,
            reading.eccentricity_ratio,
            reading.oil_temperature_c,
            reading.attitude_deg,
            value.ln_k,
            value.u_random,
            value.evidence,
        )
        baseline = self._baselines.get(reading.bearing)
        learned = baseline.of(Watched.STIFFNESS, direction) if baseline else None
        before = self._decisions.get(place, UNDECIDED)
        decision = advance(before, watched, learned, self._rules.change)
        self._decisions[place] = decision
        is_compared = decision.last_counted_ns == watched.time_ns
        return film_finding(decision, is_compared, baseline.origin.version if baseline else None)
