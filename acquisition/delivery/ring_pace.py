"""How often a ring is polled, so that the device's clock can be told from its slots."""

import math

_SHARES: tuple[float, float] = ((3.0 - 5.0**0.5) / 2.0, (5.0**0.5 - 1.0) / 2.0)
"""Of a turn: multiples of the golden section fill an interval most evenly (Weyl 1916)."""


def out_of_step_s(longest_s: float, slot_s: float) -> float:
    """Longest period up to a limit in which polls meet a slot at all of its ages.

    A slot shows when its last sample was taken only to a poll that comes as it is finished. Where
    period and slot have a small ratio, as 0.25 s and 50 samples at 600 Hz have, polls meet all
    slots at the same age; while a device drifts through a whole slot it then seems not to drift at
    all, and after that to jump.
    """
    if slot_s <= longest_s:
        return slot_s * _golden_up_to(longest_s / slot_s)
    return slot_s / _golden_from(slot_s / longest_s)


def _golden_up_to(ratio: float) -> float:
    whole = math.floor(ratio)
    return max(n + share for n in (whole - 1, whole) for share in _SHARES if n + share <= ratio)


def _golden_from(ratio: float) -> float:
    whole = math.floor(ratio)
    return min(n + share for n in (whole, whole + 1) for share in _SHARES if n + share >= ratio)
