"""What disks, cables and memory do to bytes."""

from collections.abc import Callable, Mapping

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


def zero_page(content: bytearray, rng: np.random.Generator) -> None:
    """A page holds nothing."""
    _put(content, rng, PAGE_BYTES, bytes(PAGE_BYTES))


def zero_sector(content: bytearray, rng: np.random.Generator) -> None:
    """A sector holds nothing."""
    _put(content, rng, SECTOR_BYTES, bytes(SECTOR_BYTES))


def noise(content: bytearray, rng: np.random.Generator) -> None:
    """A sector holds anything."""
    _put(content, rng, SECTOR_BYTES, rng.bytes(SECTOR_BYTES))


def swap(content: bytearray, rng: np.random.Generator) -> None:
    """Two sectors are in each other's place."""
    _swap(content, rng, SECTOR_BYTES)


def swap_pages(content: bytearray, rng: np.random.Generator) -> None:
    """Two pages are in each other's place."""
    _swap(content, rng, PAGE_BYTES)


def cut(content: bytearray, rng: np.random.Generator) -> None:
    """The end is missing."""
    del content[int(rng.integers(len(content))) :]


CHANGES: Mapping[str, Change] = {
    change.__name__: change
    for change in (flip, flips, zero_page, zero_sector, noise, swap, swap_pages, cut)
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


def _swap(content: bytearray, rng: np.random.Generator, size: int) -> None:
    n = len(content) // size
    if n < 2:
        return
    one, other = (int(place) * size for place in rng.choice(n, 2, replace=False))
    held = content[one : one + size]
    content[one : one + size] = content[other : other + size]
    content[other : other + size] = held
