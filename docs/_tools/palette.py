"""PNG files with a palette: pictures of the dashboard need at most 256 colours."""

import struct
import zlib

import numpy as np
import numpy.typing as npt

N_COLOURS = 256

Pixels = npt.NDArray[np.uint8]


def indexed_png(pixels: Pixels) -> bytes:
    """Write a picture with as many of its colours as fit; all others become the nearest of these.

    Parameters
    ----------
    pixels : (height, width, 3)
        Red, green and blue.
    """
    height, width, _ = pixels.shape
    packed = pixels.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    colours, place, counts = np.unique(packed, return_inverse=True, return_counts=True)
    kept = _chosen(colours[np.argsort(counts)[::-1]])
    nearest = _nearest(_parts(colours), _parts(kept))
    rows = nearest[place].reshape(height, width).astype(np.uint8)
    filtered = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1)
    return b"".join(
        (
            b"\x89PNG\r\n\x1a\n",
            _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)),
            _chunk(b"PLTE", _parts(kept).astype(np.uint8).tobytes()),
            _chunk(b"IDAT", zlib.compress(filtered.tobytes(), 9)),
            _chunk(b"IEND", b""),
        )
    )


def _chosen(colours: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
    """Return one colour of each kind, the most frequent first, so that small marks keep theirs."""
    kinds = (_parts(colours) >> 5) @ np.array([64, 8, 1], dtype=np.int32)
    _, first = np.unique(kinds, return_index=True)
    rest = np.setdiff1d(np.arange(len(colours)), first)
    return np.sort(colours[np.concatenate([np.sort(first), rest])[:N_COLOURS]])


def _parts(packed: npt.NDArray[np.uint32]) -> npt.NDArray[np.int32]:
    return np.stack([packed >> 16, packed >> 8 & 255, packed & 255], axis=-1).astype(np.int32)


def _nearest(colours: npt.NDArray[np.int32], kept: npt.NDArray[np.int32]) -> npt.NDArray[np.intp]:
    """Return the index of the nearest palette colour for each, a thousand at a time."""
    parts = np.array_split(colours, max(1, len(colours) // 1000))
    found = [((part[:, None] - kept[None]) ** 2).sum(-1).argmin(1) for part in parts]
    return np.concatenate(found)


def _chunk(kind: bytes, content: bytes) -> bytes:
    checksum = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)
