"""What is refused of names, passwords, accounts and keys, as problems."""

from collections.abc import Iterator
from contextlib import contextmanager

from service.api.auth.passwords import PasswordRefusedError
from service.api.auth.work import TooManyLoginsError
from service.api.problems import ProblemError
from service.store.access.identities import NameRefusedError
from service.store.access.port import AccessRefusedError


@contextmanager
def told_as_problems(password: str = "password") -> Iterator[None]:  # noqa: S107
    """Answer with a problem what is refused within.

    Parameters
    ----------
    password
        Name of the parameter that a new password stands in.
    """
    try:
        yield
    except NameRefusedError as error:
        raise ProblemError(422, "Wrong parameter", str(error), "name") from error
    except PasswordRefusedError as error:
        raise ProblemError(422, "Wrong parameter", str(error), password) from error
    except AccessRefusedError as error:
        raise ProblemError(409, "Does not fit", str(error)) from error
    except TooManyLoginsError as error:
        detail = "too many passwords are being checked: try again"
        raise ProblemError(503, "Busy", detail, headers={"Retry-After": "1"}) from error
