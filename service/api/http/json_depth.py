"""How deep JSON is nested, before anything recursive reads it."""

import re

TOKEN = re.compile(rb'"(?:[^"\\]++|\\.)*+"?|[\[{]|[\]}]', re.DOTALL)
"""A string, or what remains of one that is not closed; or a bracket. Never goes back."""


def is_deeper_than(limit: int, text: bytes) -> bool:
    """Whether lists and objects are nested deeper; the text need not be correct."""
    if text.count(b"[") + text.count(b"{") <= limit:
        return False  # as of all sound requests: cheaper than to look at each string
    depth = 0
    for match in TOKEN.finditer(text):
        first = text[match.start()]
        if first in b"[{":
            depth += 1
            if depth > limit:
                return True
        elif first in b"]}":
            depth -= 1
    return False
