"""`LinkNews`: what acquisition says of the link to a unit, beside its samples."""

from dataclasses import dataclass

from service.live.live_view import LinkState


@dataclass(frozen=True)
class LinkNews:
    """The link to a unit's device is up, has failed, or its recording has ended.

    Parameters
    ----------
    reason
        Why there are no samples, in words; None while there are.
    """

    unit: str
    state: LinkState
    reason: str | None = None

    @property
    def is_connected(self) -> bool:
        """Whether samples arrive."""
        return self.state is LinkState.CONNECTED
