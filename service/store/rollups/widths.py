"""How wide the spans of roll-ups are."""

NS_PER_S = 1_000_000_000
WIDTHS_S = (60, 600, 3600)
"""Finest first; each divides the next, and the last one is that of what is redone."""

WIDTHS_NS = tuple(width * NS_PER_S for width in WIDTHS_S)
HOUR_NS = WIDTHS_NS[-1]
