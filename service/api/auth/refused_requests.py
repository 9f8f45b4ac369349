"""How those are answered who are not let in; the words tell nothing of what was shown."""

from math import ceil

from service.api.problems import ProblemError

BEARER_ONLY = {"WWW-Authenticate": 'Bearer realm="padwatch"'}
"""No scheme that browsers would ask people about."""


def not_logged_in() -> ProblemError:
    """For nobody in particular, where somebody is needed."""
    detail = "log in, or send a key that is valid"
    return ProblemError(401, "Not logged in", detail, headers=BEARER_ONLY)


def not_let_in() -> ProblemError:
    """For a login that was tried and is wrong; not said in what."""
    detail = "the name or the password is wrong"
    return ProblemError(401, "Not let in", detail, headers=BEARER_ONLY)


def must_wait(wait_s: float) -> ProblemError:
    """For a login that was not tried, after too many that were wrong."""
    detail = "too many logins went wrong: wait before the next one"
    return ProblemError(429, "Wait", detail, headers={"Retry-After": str(max(1, ceil(wait_s)))})


def not_allowed() -> ProblemError:
    """For somebody whose role is not enough."""
    return ProblemError(403, "Not allowed", "your role does not allow this")


def must_change_password() -> ProblemError:
    """For somebody whose password was set by somebody else."""
    detail = "your password was set by somebody else: change it first"
    return ProblemError(403, "Change your password", detail)


def not_this_unit() -> ProblemError:
    """For a key of some units, where it is about others."""
    detail = "this key is for some units only: ask for one of those"
    return ProblemError(403, "Not allowed", detail)


def not_this_site() -> ProblemError:
    """For a page of another origin."""
    detail = "a page of another site asks for it: that is refused"
    return ProblemError(403, "Not from this site", detail)
