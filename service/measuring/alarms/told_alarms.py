"""`ToldAlarms`: alarms whose conditions somebody finds who knows nothing else of alarms."""

from collections.abc import Iterable, Sequence

from core.alarms.alarm import Alarm, AlarmNews
from core.alarms.board import AlarmBoard
from core.alarms.kinds import Watch
from core.alarms.operation import Action
from core.limits import WITHIN, Judgement


class ToldAlarms:
    """Owns alarms of some watches; what was told of each counts from the next tick on."""

    def __init__(self, watches: Iterable[Watch]) -> None:
        self._watches = {watch.id: watch for watch in watches}
        self._board = AlarmBoard(self._watches.values())
        self._found: dict[str, Judgement] = {}
        self._once: set[str] = set()

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All of them, whatever their state."""
        return self._board.alarms

    def __contains__(self, id_: str) -> bool:
        return id_ in self._board

    def alarm(self, id_: str) -> Alarm:
        """Look one up. Raises `KeyError` if there is no such alarm."""
        return self._board.alarm(id_)

    def tell(self, id_: str, condition: Judgement) -> None:
        """Note what is found; it lasts until something else is told."""
        self._found[id_] = condition
        self._once.discard(id_)

    def tell_once(self, id_: str, condition: Judgement) -> None:
        """Note what has happened, and is over already."""
        self.tell(id_, condition)
        self._once.add(id_)

    def operate(self, id_: str, action: Action, host_ns: int) -> list[AlarmNews]:
        """Do what somebody asks for; raises as `AlarmBoard.operate` does."""
        self._board.operate(id_, action, host_ns)
        return self._board.drain_news()

    def restore(self, alarms: Iterable[Alarm], host_ns: int) -> list[AlarmNews]:
        """Go on where somebody stopped."""
        self._board.restore(alarms, host_ns)
        return self._board.drain_news()

    def pause(self) -> None:
        """Let all delays stand still up to now."""
        self._board.pause()

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Judge what was told last."""
        for id_, condition in self._found.items():
            self._board.update(self._watches[id_], condition, host_ns)
        for id_ in self._once:
            self._found[id_] = WITHIN
        self._once.clear()
        self._board.expire(host_ns)
        return self._board.drain_news()
