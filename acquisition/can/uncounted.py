"""`UncountedInstants`: sample instants of a device that counts nothing; the clock finds losses."""

from acquisition.can.plan import Instant, Part, Plan, Refusal, RefusalCounts
from core.samples.axis import Epochs
from core.units import NS_PER_S

MAX_UNSURE_NS = NS_PER_S
"""Samples that arrive late for longer than this were not late: others before them are lost."""

MAX_INSTANTS_PER_S = 1250.0
"""Up to here a second of drift is less than half an instant, so that each missing one is told."""

_OTHER_LOSS_NS = NS_PER_S // 4
"""Samples that are later by so much than those before have lost others since."""

_MAX_DRIFT = 300e-6
"""Twice what the crystals of device and host can differ, and some."""


_WINDOW_NS = NS_PER_S // 4
_FAST_SHARE = 0.2
_FAST_WINDOWS = 2
"""What waited before the bus was opened, and a host's clock that is put back, fill one window."""


class ArrivalCheck:
    """Whether as many samples have arrived as the time that passed calls for.

    Samples can be late, never early: the least delay seen is none, and a sample that comes with as
    little shows that none before it was lost. Less than half of what a single instant takes is as
    little.

    Parameters
    ----------
    max_drift
        Share by which a device may sample too slowly: so fast the least delay is forgotten.

    Attributes
    ----------
    n_fast
        Windows in a row with more samples than a device of this rate has.
    """

    def __init__(self, rate_hz: float, instant_samples: int, max_drift: float = _MAX_DRIFT) -> None:
        self._period_ns = NS_PER_S / rate_hz
        self._max_drift = max_drift
        self._instant_samples = instant_samples
        self._origin_ns: int | None = None
        self._window_ns = 0
        self._early_ns = 0.0
        self.n_fast = 0
        self._least_ns = 0.0
        self._previous_ns = 0

    def delay_ns(self, stop_index: int, arrived_ns: int) -> float:
        """How late samples up to an index are, against the least delay seen."""
        if self._origin_ns is None:
            self._origin_ns = self._previous_ns = self._window_ns = arrived_ns
            self._least_ns = -stop_index * self._period_ns
        delay_ns = arrived_ns - self._origin_ns - stop_index * self._period_ns
        passed_ns = min(max(0, arrived_ns - self._previous_ns), MAX_UNSURE_NS)
        self._least_ns += self._max_drift * passed_ns
        self._previous_ns = arrived_ns
        self._early_ns += max(0.0, self._least_ns - delay_ns)
        self._least_ns = min(self._least_ns, delay_ns)
        self._judge_pace(arrived_ns)
        return delay_ns - self._least_ns

    @property
    def are_too_many(self) -> bool:
        """Whether more samples come, and not for once only, than a device of this rate has."""
        return self.n_fast >= _FAST_WINDOWS

    def is_prompt(self, delay_ns: float) -> bool:
        """Whether a delay is so small that nothing can have been lost."""
        return delay_ns < self._instant_ns / 2

    def n_lost(self, delay_ns: float) -> int:
        """Samples whose loss explains a delay that does not go away."""
        return self._instant_samples * max(1, round(delay_ns / self._instant_ns))

    def _judge_pace(self, arrived_ns: int) -> None:
        passed_ns = arrived_ns - self._window_ns
        if abs(passed_ns) < _WINDOW_NS:
            return
        is_fast = self._early_ns > _FAST_SHARE * passed_ns > 0.0
        self.n_fast = self.n_fast + 1 if is_fast else 0
        self._window_ns, self._early_ns = arrived_ns, 0.0

    @property
    def _instant_ns(self) -> float:
        return self._instant_samples * self._period_ns


class UncountedInstants:
    """Counts complete sets of frames; hands them on when the clock has confirmed the count.

    The frames of a set come in a fixed order; one that is out of turn shows that its set is not
    complete.

    Parameters
    ----------
    refused
        Where refused frames are counted.
    begun_ns
        When this life of the adapter began, UTC: it counts for the device, so that another life
        is another count, whatever the device tells.

    Attributes
    ----------
    n_complete
        Sets that have been complete, confirmed or not.
    """

    def __init__(
        self, plan: Plan, rate_hz: float, refused: RefusalCounts, begun_ns: int = 0
    ) -> None:
        self._plan = plan
        self._refused = refused
        self._rate_hz = rate_hz
        self._epochs = Epochs(begun_ns, trusts_device=False)
        self._told: int | None = None
        self.n_complete = 0
        self._begin()

    def _begin(self) -> None:
        self._check = ArrivalCheck(self._rate_hz, self._plan.samples_per_frame)
        self._frames: list[bytes] = []
        self._last_wave = self._plan.n_waves
        self._spoilt = False
        self._held: list[Instant] = []
        self._next = 0
        self._n_incomplete = 0
        self._least_delay_ns = 0.0
        self._unsure_since_ns: int | None = None
        self._pending_loss = 0

    @property
    def epoch(self) -> int:
        """Number of the present count."""
        return self._epochs.number

    @property
    def next_index(self) -> int:
        """First sample that has not been completed."""
        return self._next

    @property
    def are_too_many(self) -> bool:
        """Whether more samples come than a single device of this rate has."""
        return self._check.are_too_many

    def set_epoch(self, epoch: int) -> bool:
        """Take over an epoch that the device told; return whether it began to count anew."""
        if epoch == self._told:
            return False
        self._told = epoch
        self._epochs.begin(epoch)
        self._begin()
        return True

    def begin_again(self) -> bool:
        """Begin another count if there was one, since nothing counts what was not listened to.

        Whether more samples come than a single device has stays known.
        """
        had_begun, n_fast = self._next > 0, self._check.n_fast
        if had_begun:
            self._epochs.begin()
        self._begin()
        self._check.n_fast = n_fast
        return had_begun

    def refuse_frame(self, part: Part) -> None:
        """Note that a frame of a message came but could not be used: its set is incomplete."""
        if part.wave is not None:
            self._turn(part.wave)
            self._spoil()

    def put(self, wave: int, data: bytes) -> None:
        """Take the next frame of a waveform message."""
        self._turn(wave)
        if self._spoilt:
            self._refused[Refusal.INCOMPLETE] += 1
            return
        self._frames.append(data)
        if len(self._frames) == self._plan.n_waves:
            self._complete()

    def confirmed(self, arrived_ns: int) -> list[Instant]:
        """Hand on what the clock confirms, at the end of each batch of frames."""
        if not self._held:
            return []
        delay_ns = self._check.delay_ns(self._next, arrived_ns)
        if self._check.is_prompt(delay_ns):
            self._unsure_since_ns = None
            held, self._held = self._held, []
            return held
        is_more = delay_ns > self._least_delay_ns + _OTHER_LOSS_NS
        if self._unsure_since_ns is None or is_more:
            self._unsure_since_ns, self._least_delay_ns = arrived_ns, delay_ns
        self._least_delay_ns = min(self._least_delay_ns, delay_ns)
        if arrived_ns - self._unsure_since_ns > MAX_UNSURE_NS:
            self._lose_held()
        return []

    def _complete(self) -> None:
        n_samples = self._plan.samples_per_frame
        rejected = {
            Refusal.INCOMPLETE: self._n_incomplete,
            Refusal.UNCOUNTED_LOSS: self._pending_loss,
        }
        instant = Instant(
            self.epoch,
            self._next,
            n_samples,
            tuple(self._frames),
            {reason: n for reason, n in rejected.items() if n},
        )
        self._held.append(instant)
        self.n_complete += 1
        self._frames = []
        self._n_incomplete = self._pending_loss = 0
        self._next += n_samples

    def _turn(self, wave: int) -> None:
        """Notice where a set begins; one that is complete by then had all its frames in turn."""
        if wave <= self._last_wave:
            if self._frames:
                self._spoil()
            self._spoilt = False
        self._last_wave = wave

    def _spoil(self) -> None:
        """Give up the set that is being collected: it counts, but is not used."""
        self._frames = []
        if not self._spoilt:
            self._spoilt = True
            self._n_incomplete += self._plan.samples_per_frame
            self._next += self._plan.samples_per_frame

    def _lose_held(self) -> None:
        """Somewhere among these samples others are missing: none of them can be used."""
        n_lost = self._check.n_lost(self._least_delay_ns)
        n_held = sum(instant.n_samples for instant in self._held)
        told = sum(sum(instant.rejected.values()) for instant in self._held)
        self._pending_loss += n_lost + n_held + told
        self._next += n_lost
        self._held = []
        self._unsure_since_ns = None
