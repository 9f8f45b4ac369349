"""What the API's routes look at and ask: in this process, or through the database."""

from collections.abc import Mapping, Sequence, Set
from typing import Protocol

from core.alarms.alarm import Alarm
from core.alarms.judgements import VectorReference
from core.alarms.operation import Action
from core.baseline.baseline import BearingBaseline
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from core.monitor.assessment import Assessment
from core.quality import Reason
from core.samples.blocks import SampleBlock
from service.live.commands import BaselineAction, FilmPlace
from service.live.live_view import CurrentBearing, UnitStatus
from service.settings.films import FilmAlarmSettings


class LiveLook(Protocol):
    """What is known now; see :class:`service.live.live_view.LiveView`."""

    @property
    def revision(self) -> int:
        """Another number as soon as a link has changed or a result has come."""
        ...

    @property
    def store_error(self) -> str | None:
        """Why results are not stored, or cannot be read; None if nothing is wrong."""
        ...

    @property
    def n_unstored(self) -> int:
        """Findings that were given up."""
        ...

    def status(self, unit: str) -> UnitStatus:
        """How samples of a unit arrive."""
        ...

    def blocks(self, unit: str) -> Sequence[SampleBlock]:
        """The newest blocks of a unit. Raises `NotHereError` where there are none to be had."""
        ...

    def newest_block(self, unit: str) -> SampleBlock | None:
        """The newest block of a unit; None where there is none, or none to be had."""
        ...

    def why_no_samples(self, unit: str) -> Reason | None:
        """Why the newest samples of a unit are not current; None if they are."""
        ...

    def data_age_s(self, unit: str) -> float | None:
        """Time since the newest block arrived; None if none has."""
        ...

    def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """The newest result whole, with spectrum and orbit. Raises as `blocks` does."""
        ...

    def current(self, unit: str, bearing: str) -> CurrentBearing:
        """The newest result as it may be shown: nothing old passes for current."""
        ...


class FilmBoard(Protocol):
    """The films of all bearings; see :class:`service.measuring.films.keeper.FilmKeeper`."""

    @property
    def unwatched(self) -> Mapping[str, str]:
        """Why films cannot be watched, by unit where they cannot."""
        ...

    @property
    def settings(self) -> FilmAlarmSettings:
        """How films are watched."""
        ...

    def rules(self, unit: str) -> FilmRules | None:
        """How the films of a unit are watched; None if they are not."""
        ...

    def place(self, unit: str, bearing: str) -> FilmPlace | None:
        """A bearing with the estimator that it is watched by; None if it is not watched."""
        ...

    def newest(self, unit: str, bearing: str) -> FilmNews | None:
        """What has been said of a bearing last."""
        ...

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """What a bearing is compared with now."""
        ...


class CaptureLook(Protocol):
    """Samples around alarms; see :class:`service.recordings.capture.captures.Captures`."""

    @property
    def error(self) -> str | None:
        """Why the last capture could not be written; None since one could."""
        ...

    @property
    def trouble(self) -> str | None:
        """Why samples are not kept now."""
        ...

    @property
    def n_running(self) -> int:
        """Captures that are being made now."""
        ...

    @property
    def n_written(self) -> int:
        """Captures finished since the start."""
        ...

    @property
    def being_made(self) -> Set[tuple[str, int]]:
        """Alarms and occurrences around which samples are being written now."""
        ...


class Operators(Protocol):
    """Does what people ask for, wherever their unit is analysed."""

    async def operate(self, id_: str, action: Action) -> Alarm:
        """Do something to an alarm; returns it as it is then, on the disk.

        Raises
        ------
        LookupError
            If there is no such alarm.
        ActionRefusedError
            If it does not fit the alarm as it is now.
        NotCarriedOutError
            If nobody does it, or the disk does not answer.
        """
        ...

    async def act(self, place: FilmPlace, action: BaselineAction, actor: str, reason: str) -> None:
        """Do something to the baselines of a bearing, on the disk when this returns.

        Raises
        ------
        BaselineRefusedError
            If it does not fit the baselines as they are now.
        NotCarriedOutError
            If nobody does it.
        """
        ...

    async def refer_to(self, reference: VectorReference) -> None:
        """Compare 1× vectors with a reference that has just been stored."""
        ...
