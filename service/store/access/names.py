"""Names of accounts and keys."""

import re

MAX_NAME = 64
NAME = re.compile(r"[a-z0-9](?:[a-z0-9._@-]{0,62}[a-z0-9])?", re.ASCII)


class NameRefusedError(ValueError):
    """No name for an account or a key; the message says what is."""


def account_name(written: str) -> str:
    """Bring a name to the one way in which it is stored: a name is not told apart by its case.

    Raises
    ------
    NameRefusedError
        If it is none.
    """
    name = written.strip().lower()
    if NAME.fullmatch(name) is None:
        raise NameRefusedError(
            f"a name has 1 to {MAX_NAME} of a-z 0-9 . _ @ - and begins and ends with a letter"
            " or a digit"
        )
    return name
