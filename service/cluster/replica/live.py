"""`ReplicaLive`: what is known now, as the processes that analyse have written it down."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from acquisition.clock import Clock
from core.alarms.alarm import PLANT
from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from core.quality import Reason, bad, missing
from core.samples.blocks import SampleBlock
from core.spectra.cross_spectrum import NO_SPECTRUM
from service.cluster.replica.delays import Delays
from service.live.commands import NotHereError
from service.live.live_view import CurrentBearing, LinkState, UnitStatus
from service.live.unit_state import BearingState, UnitSigns
from service.measuring.service_alarms import SHARED

SILENT_AFTER_S = 5.0
"""Reports come every second: who misses several of them is not there, or not reached."""

NOBODY = "no process that analyses this unit gives a sign of life"


@dataclass(frozen=True)
class Known:
    """What was read of a unit last.

    Parameters
    ----------
    beat
        Process and number of the report.
    heard_s
        When it was said, on this process's steady clock: when it was first seen to be another one
        than before, less what it was held up on its way. None if it is the first one of a process:
        nobody knows how old it is.
    shown, silent
        Status while there are signs of life, and when there are none.
    """

    beat: tuple[str, int] | None
    heard_s: float | None
    signs: UnitSigns
    shown: UnitStatus
    silent: UnitStatus
    results: Mapping[str, Assessment] = field(default_factory=dict)


NOTHING = Known(None, None, UnitSigns(UnitStatus(), None, {}), UnitStatus(), UnitStatus())


class ReplicaLive:
    """The newest of everything, by the newest reports; nothing old passes for current.

    Ages are measured by this process's steady clock from the moment at which it saw a report, less
    the report's delay, so that hosts' clocks need not agree and a database that has kept a report
    back makes nothing younger.

    Parameters
    ----------
    stale_after_s
        A result older than this is no longer current.
    """

    def __init__(self, units: Iterable[str], clock: Clock, stale_after_s: float) -> None:
        self._clock, self._stale_after_s = clock, stale_after_s
        self._delays = Delays()
        self._known = dict.fromkeys((*units, PLANT, SHARED), NOTHING)
        self.revision = 0
        self.read_error: str | None = None
        """Why reports cannot be read just now."""

    @property
    def units(self) -> Sequence[str]:
        """All units, `PLANT` and `SHARED`."""
        return tuple(self._known)

    def hear(self, unit: str, process: str, n_beats: int, signs: UnitSigns) -> None:
        """Take the newest report on a unit; one that is known already tells nothing."""
        known, beat = self._known[unit], (process, n_beats)
        if known.beat == beat:
            return
        self.revision += 1
        now_s = self._clock.monotonic_s()
        delay_s = self._delays.delay_s(process, signs.said_s, now_s)
        is_first = known.beat is None or known.beat[0] != process
        heard_s = None if is_first else now_s - delay_s
        received_s = None
        if heard_s is not None and signs.data_age_s is not None:
            received_s = heard_s - signs.data_age_s
        shown = replace(signs.status, received_s=received_s)
        silent = replace(shown, state=LinkState.NOT_CONNECTED, reason=NOBODY, since_ns=None)
        self._known[unit] = replace(
            known, beat=beat, heard_s=heard_s, signs=signs, shown=shown, silent=silent
        )

    def set_results(self, unit: str, results: Mapping[str, BearingState]) -> None:
        """Take the newest results of a unit."""
        self.revision += 1
        found = {b: _assessment(unit, b, state) for b, state in results.items()}
        self._known[unit] = replace(self._known[unit], results=found)

    def silence_s(self, unit: str) -> float | None:
        """Time since the last sign of life of whoever analyses a unit; None if there was none."""
        heard_s = self._known[unit].heard_s
        return None if heard_s is None else self._clock.monotonic_s() - heard_s

    def is_alive(self, unit: str) -> bool:
        """Whether somebody analyses a unit, and says so."""
        silence_s = self.silence_s(unit)
        return silence_s is not None and silence_s <= SILENT_AFTER_S

    @property
    def store_error(self) -> str | None:
        """Why reports cannot be read, or a process that is there cannot store."""
        said = (self._known[u].signs.store_error for u in self._known if self.is_alive(u))
        return self.read_error or next((error for error in said if error), None)

    @property
    def n_unstored(self) -> int:
        """Findings that processes have given up since they were started."""
        by_process = {k.beat[0]: k.signs.n_unstored for k in self._known.values() if k.beat}
        return sum(by_process.values())

    def status(self, unit: str) -> UnitStatus:
        """How samples of a unit arrive; nobody knows that of a unit that nobody reports on."""
        known = self._known[unit]
        if known.beat is None:
            return NOT_REPORTED
        return known.shown if self.is_alive(unit) else known.silent

    def blocks(self, unit: str) -> Sequence[SampleBlock]:
        """Raise `NotHereError`: samples stay in the process that analyses them."""
        raise NotHereError(f"live samples of unit {unit} are not available from this replica")

    def newest_block(self, unit: str) -> SampleBlock | None:  # noqa: ARG002  as the port has it
        """Return None: samples stay in the process that analyses them."""
        return None

    def why_no_samples(self, unit: str) -> Reason | None:
        """Why the newest samples of a unit are not current; None if they are."""
        return self._why_not_current(unit, self.data_age_s(unit))

    def data_age_s(self, unit: str) -> float | None:
        """Time since the newest block arrived where it is analysed; None if nobody knows."""
        return self._age_s(unit, self._known[unit].signs.data_age_s)

    def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """Nothing if there is no result; else raise `NotHereError`: arrays stay where they are."""
        if bearing not in self._known[unit].results:
            return None
        raise NotHereError(
            f"live spectra and orbits of unit {unit} are not available from this replica;"
            " spectra over time are"
        )

    def current(self, unit: str, bearing: str) -> CurrentBearing:
        """The newest result as it may be shown."""
        known = self._known[unit]
        result = known.results.get(bearing)
        age_s = self._age_s(unit, known.signs.result_ages_s.get(bearing))
        reason = self._why_not_current(unit, age_s)
        if result is None or reason is not None:
            nothing = missing(reason or Reason.WAITING_FOR_DATA)
            return CurrentBearing(
                assessment=result,
                age_s=age_s,
                quality=bad(nothing.quality.reason),
                readings={quantity.name: nothing for quantity in CATALOGUE},
                is_current=False,
            )
        return CurrentBearing(result, age_s, result.quality, result.readings, is_current=True)

    def _age_s(self, unit: str, then_s: float | None) -> float | None:
        silence_s = self.silence_s(unit)
        return None if then_s is None or silence_s is None else then_s + silence_s

    def _why_not_current(self, unit: str, age_s: float | None) -> Reason | None:
        if self.status(unit).state is not LinkState.CONNECTED:
            return Reason.NOT_CONNECTED
        if age_s is None:
            return Reason.WAITING_FOR_DATA
        return Reason.STALE if age_s > self._stale_after_s else None


NOT_REPORTED = UnitStatus(LinkState.NOT_CONNECTED, NOBODY)


def _assessment(unit: str, bearing: str, state: BearingState) -> Assessment:
    return Assessment(unit, bearing, spectrum=NO_SPECTRUM, orbit=None, **vars(state))
