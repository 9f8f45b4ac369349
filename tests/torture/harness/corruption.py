"""What disks, cables and memory do to bytes."""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

SECTOR_BYTES = 512
PAGE_BYTES = 8192

Change = Callable[[bytearray, np.random.Generator], None]


def flip(content: bytearray, rng: np.random.Generator) -> None:
    """One bit is another."""
    content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))


def flips(content: bytearray, rng: np.random.Generator) -> None:
    """Some bits are others."""
    for _ in range(int(rng.integers(2, 40))):
        flip(content, rng)


def zero(content: bytearray, rng: np.random.Generator, size: int) -> None:
    """A sector or a page holds nothing."""
    _put(content, rng, size, bytes(size))


def noise(content: bytearray, rng: np.random.Generator) -> None:
    """A sector holds anything."""
    _put(content, rng, SECTOR_BYTES, rng.bytes(SECTOR_BYTES))


def swap(content: bytearray, rng: np.random.Generator, size: int) -> None:
    """Two sectors or pages are in each other's place."""
    n = len(content) // size
    if n < 2:
        return
    one, other = (int(place) * size for place in rng.choice(n, 2, replace=False))
    held = content[one : one + size]
    content[one : one + size] = content[other : other + size]
    content[other : other + size] = held


def cut(content: bytearray, rng: np.random.Generator) -> None:
    """The end is missing."""
    del content[int(rng.integers(len(content))) :]


CHANGES: Mapping[str, Change] = {
    "flip": flip,
    "flips": flips,
    "zero_page": partial(zero, size=PAGE_BYTES),
    "zero_sector": partial(zero, size=SECTOR_BYTES),
    "noise": noise,
    "swap": partial(swap, size=SECTOR_BYTES),
    "swap_pages": partial(swap, size=PAGE_BYTES),
    "cut": cut,
}


def corrupted(content: bytes, kind: str, rng: np.random.Generator) -> bytes:
    """Some bytes after something has gone wrong with them; not the same as before."""
    while True:
        changed = bytearray(content)
        CHANGES[kind](changed, rng)
        if changed != content:
            return bytes(changed)
        kind = "flip"


def _put(content: bytearray, rng: np.random.Generator, size: int, data: bytes) -> None:
    start = int(rng.integers(-(-len(content) // size))) * size
    end = min(start + size, len(content))
    content[start:end] = data[: end - start]
