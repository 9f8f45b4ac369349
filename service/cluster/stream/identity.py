"""Whose blocks they are: fingerprints of the plant and of what the blocks of a unit hold."""

import hashlib
import json
from dataclasses import dataclass

FINGERPRINT_BYTES = 16


@dataclass(frozen=True)
class UnitIdentity:
    """A unit as the blocks on a stream must have been made for it.

    Parameters
    ----------
    unit
        Its id.
    plant
        Fingerprint of the plant's name.
    make
        Fingerprint of rate and channels: samples of another make would be read as something else.
    """

    unit: str
    plant: bytes
    make: bytes


def fingerprint(*words: object) -> bytes:
    """A short mark of some JSON values: equal for equal ones, and for no others that occur."""
    text = json.dumps(words, ensure_ascii=True, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).digest()[:FINGERPRINT_BYTES]
