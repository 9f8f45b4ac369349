"""Why a message of a stream is refused."""


class WireError(ValueError):
    """A message cannot be used; it will be the same the next time.

    Parameters
    ----------
    kind
        Short snake-case word, used as a counter's label.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind
