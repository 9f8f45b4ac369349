"""`Delays`: how long reports were on their way, by two clocks that know nothing of each other."""

DRIFT = 1e-3
"""Two steady clocks differ by far less."""


class Delays:
    """Compares each report with the quickest of its process: steady clocks are a constant apart.

    What every report takes at least is not seen: a look at the database twice a second keeps it
    below half a second.
    """

    def __init__(self) -> None:
        self._quickest: dict[str, tuple[float, float]] = {}

    def delay_s(self, process: str, said_s: float | None, heard_s: float) -> float:
        """For how much longer than the quickest this report was on its way.

        Parameters
        ----------
        said_s
            On the process's steady clock; None if it does not say so.
        heard_s
            On the steady clock of whoever asks.
        """
        if said_s is None:
            return 0.0
        apart_s = heard_s - said_s
        quickest_s, seen_s = self._quickest.get(process, (apart_s, heard_s))
        quickest_s = min(apart_s, quickest_s + DRIFT * (heard_s - seen_s))
        self._quickest[process] = (quickest_s, heard_s)
        return apart_s - quickest_s
