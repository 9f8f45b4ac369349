"""How long a login lasts."""

from dataclasses import dataclass, field

NS_PER_S = 1_000_000_000


@dataclass(frozen=True)
class Session:
    """A login of an account, as it is stored.

    Parameters
    ----------
    digest
        Of the token in the browser's cookie.
    seen_ns
        When it was last used, to `SessionLimits.step_s`.
    """

    digest: bytes = field(repr=False)
    account: str
    created_ns: int
    seen_ns: int


@dataclass(frozen=True)
class SessionLimits:
    """When a login ends by itself.

    Parameters
    ----------
    idle_s
        After the last use.
    absolute_s
        After the login, whatever is done with it.
    step_s
        How exactly the last use is noted; each note is a write to the disk.
    slack_s
        How far a session may lie in the future: a host's clock may be put right by so much.
    """

    idle_s: float = 1800.0
    absolute_s: float = 43_200.0
    step_s: float = 60.0
    slack_s: float = 300.0

    def is_live(self, session: Session, now_ns: int) -> bool:
        """Whether a session may still be used.

        One from the future is not: a clock that was years ahead must leave no eternal logins.
        """
        age_s = (now_ns - session.created_ns) / NS_PER_S
        idle_s = (now_ns - session.seen_ns) / NS_PER_S
        return -self.slack_s <= age_s < self.absolute_s and -self.slack_s <= idle_s < self.idle_s

    def is_news(self, session: Session, now_ns: int) -> bool:
        """Whether the last use is so long ago that this one is to be noted."""
        return now_ns - session.seen_ns >= self.step_s * NS_PER_S

    def oldest_ns(self, now_ns: int) -> int:
        """Sessions that were begun before this are over."""
        return now_ns - round(self.absolute_s * NS_PER_S)
