"""What cannot be given or done in this process, but perhaps in another."""


class NotHereError(Exception):
    """It exists only in the process that analyses; the message says so."""


class NotCarriedOutError(Exception):
    """What somebody asked for is not done, or not on the disk; the message says which."""

    def __init__(self, title: str, detail: str) -> None:
        super().__init__(detail)
        self.title = title
