"""`Span`: which blocks belong to the capture of an alarm, and when there are no more."""

from dataclasses import dataclass, replace

from core.alarms.alarm import ANNOUNCED, AlarmEvent, AlarmState
from core.alarms.kinds import FILM_KINDS
from core.samples.blocks import SampleBlock
from core.units import ns_from_s
from service.settings.alarm_kinds import SAMPLED_KINDS


@dataclass(frozen=True)
class CaptureSettings:
    """How much is kept around an alarm.

    Parameters
    ----------
    pre_s, post_s
        Before the alarm and after it.
    max_s
        Longest capture.
    window_s
        Length of an averaging window: as much is kept before an alarm of a film.
    """

    pre_s: float = 60.0
    post_s: float = 120.0
    max_s: float = 600.0
    window_s: float = 0.0

    @property
    def longest_pre_s(self) -> float:
        """How much before an alarm is kept at most, so that what follows it fits in too."""
        return max(self.pre_s, min(self.window_s, self.max_s - self.post_s))

    def pre_of(self, kind: str) -> float:
        """How much is kept before an alarm of a kind."""
        return self.longest_pre_s if kind in FILM_KINDS else self.pre_s


def is_captured(event: AlarmEvent) -> bool:
    """Whether samples are kept around an event: a new occurrence that nothing hides."""
    return (
        event.change in ANNOUNCED
        and event.identity.kind in SAMPLED_KINDS
        and event.state_after is AlarmState.UNACKNOWLEDGED
    )


@dataclass(frozen=True)
class Span:
    """From when to when, in the time of the samples. Only whole blocks are kept.

    Parameters
    ----------
    n_samples
        Taken so far, per channel.
    max_samples
        Most that are taken, should the device's time stand still or run backwards.
    """

    start_ns: int
    end_ns: int
    last_end_ns: int
    max_samples: int
    n_samples: int = 0

    @classmethod
    def around(cls, event: AlarmEvent, rate_hz: float, settings: CaptureSettings) -> "Span":
        """The span around an alarm."""
        time_ns = event.time_ns
        start_ns = time_ns - ns_from_s(settings.pre_of(event.identity.kind))
        last_end_ns = start_ns + ns_from_s(settings.max_s)
        end_ns = time_ns + ns_from_s(settings.post_s)
        return cls(start_ns, end_ns, last_end_ns, round(settings.max_s * rate_hz))

    def reaches_back_to(self, start_ns: int, oldest_ns: int) -> bool:
        """Whether it begins by a time, or at least with the oldest samples that there are."""
        return self.start_ns <= max(start_ns, oldest_ns)

    def with_alarm(self, time_ns: int, settings: CaptureSettings) -> "Span":
        """The span prolonged by one more alarm, as far as that goes."""
        end_ns = max(self.end_ns, time_ns + ns_from_s(settings.post_s))
        return replace(self, end_ns=min(end_ns, self.last_end_ns))

    def with_block(self, block: SampleBlock) -> "Span":
        """The span when a block has been taken."""
        return replace(self, n_samples=self.n_samples + block.n_samples)

    def begins_by(self, block: SampleBlock) -> bool:
        """Whether a block from before the alarm belongs to it, if only in part."""
        return block.stop_ns > self.start_ns

    def goes_on_to(self, block: SampleBlock) -> bool:
        """Whether a block that follows belongs to it, if only in part."""
        return block.start_ns < self.end_ns and self.n_samples < self.max_samples

    def is_over(self, newest: SampleBlock) -> bool:
        """Whether nothing that follows a block can belong to it."""
        return newest.stop_ns >= self.end_ns or self.n_samples >= self.max_samples
