"""Polarity check: a film that pushes the shaft away has a transducer that counts the wrong way.

Direct stiffness and damping of a film are positive. With one transducer of a direction reversed,
the ratio of bearing to shaft motion changes its sign, and both come out negative. Amplitudes, and
with them equation (5), are not affected.
"""

from collections.abc import Mapping

from core.quality import Reading, Reason, missing

AXES = ("xx", "yy")


def signs_checked(readings: Mapping[str, Reading]) -> dict[str, Reading]:
    """Replace numbers of a reversed sign by the reason `polarity`.

    A negative direct coefficient of `dynamic` takes out all coefficients of its direction, as it is
    not known whether the shaft or the bearing transducer is reversed. A negative stiffness of
    `transfer` takes out its damping, but not the other way round: cross-coupling alone can make the
    damping that a single line shows negative.

    Parameters
    ----------
    readings
        By quantity.
    """
    found = dict(readings)
    for axes in AXES:
        crossed = {"xx": ("xx", "xy", "yx"), "yy": ("yy", "yx", "xy")}[axes]
        if any(_is_negative(readings[name]) for name in _dynamic(axes)):
            for other in crossed:
                _take_out(found, _dynamic(other))
        for line in ("order1", "vortex"):
            stiffness, damping = _transfer(line, axes)
            if _is_negative(readings[stiffness]):
                _take_out(found, (stiffness, damping))
            elif _is_negative(readings[damping]):
                _take_out(found, (damping,))
    return found


def is_reversed(readings: Mapping[str, Reading], axes: str) -> bool | None:
    """Whether a transducer of a direction is reversed, by the best estimator that can tell.

    Parameters
    ----------
    readings
        From :func:`signs_checked`.
    axes
        "xx" or "yy".

    Returns
    -------
    None if no estimator has a result.
    """
    for name in (_dynamic(axes)[0], _transfer("vortex", axes)[0], _transfer("order1", axes)[0]):
        reading = readings.get(name)
        if reading is not None and reading.quality.reason is Reason.POLARITY:
            return True
        if reading is not None and reading.value is not None:
            return False
    return None


def _dynamic(axes: str) -> tuple[str, str]:
    return f"dynamic_k_{axes}_n_per_m", f"dynamic_c_{axes}_n_s_per_m"


def _transfer(line: str, axes: str) -> tuple[str, str]:
    return f"{line}_transfer_k_{axes}_n_per_m", f"{line}_transfer_c_{axes}_n_s_per_m"


def _is_negative(reading: Reading) -> bool:
    """Whether a value is below zero by more than its uncertainty."""
    if reading.value is None:
        return False
    return (reading.value if reading.interval_95 is None else reading.interval_95[1]) < 0.0


def _take_out(readings: dict[str, Reading], names: tuple[str, ...]) -> None:
    for name in names:
        if readings[name].value is not None:
            readings[name] = missing(Reason.POLARITY)
