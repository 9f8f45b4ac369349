"""What a device means by an exception reply: whether asking again can help."""

from acquisition.errors import AcquisitionError, ConfigError, LinkError

BUSY = 6
"""The device could not take the request, and asks for it again later (MODBUS V1.1b3, section 7)."""

_CONFIG_EXCEPTIONS = {1: "illegal function", 2: "illegal address", 3: "illegal value"}
_PASSING_EXCEPTIONS = {
    4: "device failure",
    5: "acknowledge",
    BUSY: "busy",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target does not answer",
}


def refusal_error(where: str, code: int, intent: str) -> AcquisitionError:
    """Return the error that an exception code stands for.

    Parameters
    ----------
    intent
        What was asked for; example: "a read of 2 at 100".
    """
    names = _CONFIG_EXCEPTIONS | _PASSING_EXCEPTIONS
    kind = ConfigError if code in _CONFIG_EXCEPTIONS else LinkError
    name = names.get(code, "unknown")
    return kind(f"{where}: device answers exception {code} ({name}) to {intent}")
