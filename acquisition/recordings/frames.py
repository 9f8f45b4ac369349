"""`FrameBatch`: CAN frames of a log, in columns; and what makes raw blocks of them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from acquisition.delivery.raw import RawBlock
from acquisition.recordings.imports.candump import LoggedFrame

MAX_DATA = 64


@dataclass(frozen=True)
class FrameBatch:
    """Data frames in the order of the log; error frames and remote requests are left out.

    Parameters
    ----------
    times_ns
        (n,) int64, UTC.
    ids
        (n,) uint32 without flags.
    extended
        (n,) bool: whether the id has 29 bits.
    fd
        (n,) bool: whether it is a CAN FD frame.
    lengths
        (n,) uint8: bytes of data.
    data
        (n, 64) uint8, zero behind the length.
    """

    times_ns: npt.NDArray[np.int64]
    ids: npt.NDArray[np.uint32]
    extended: npt.NDArray[np.bool_]
    fd: npt.NDArray[np.bool_]
    lengths: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint8]

    @property
    def columns(self) -> tuple[npt.NDArray[np.generic], ...]:
        """All arrays, in the order of the fields."""
        return (self.times_ns, self.ids, self.extended, self.fd, self.lengths, self.data)

    @staticmethod
    def bytes_per_frame() -> int:
        """In memory."""
        return 8 + 4 + 1 + 1 + 1 + MAX_DATA

    @classmethod
    def from_bytes(cls, content: bytes, n_frames: int) -> "FrameBatch":
        """Arrays out of the bytes of all columns, one after the other."""
        at = np.cumsum([0, 8 * n_frames, 4 * n_frames, n_frames, n_frames, n_frames])
        return cls(
            np.frombuffer(content, np.int64, n_frames, int(at[0])),
            np.frombuffer(content, np.uint32, n_frames, int(at[1])),
            np.frombuffer(content, np.uint8, n_frames, int(at[2])) != 0,
            np.frombuffer(content, np.uint8, n_frames, int(at[3])) != 0,
            np.frombuffer(content, np.uint8, n_frames, int(at[4])),
            np.frombuffer(content, np.uint8, n_frames * MAX_DATA, int(at[5])).reshape(-1, MAX_DATA),
        )

    def messages(self) -> Iterator[LoggedFrame]:
        """The frames one by one, with the names that python-can has for their parts."""
        data = self.data.tobytes()
        rows = zip(
            *(part.tolist() for part in (self.times_ns, self.ids, self.extended, self.fd)),
            self.lengths.tolist(),
            strict=True,
        )
        for n, (time_ns, id_, extended, fd, length) in enumerate(rows):
            content = bytearray(data[n * MAX_DATA : n * MAX_DATA + length])
            yield LoggedFrame(
                timestamp=time_ns / 1e9,
                arbitration_id=id_,
                is_extended_id=extended,
                is_fd=fd,
                is_remote_frame=False,
                is_error_frame=False,
                dlc=length,
                data=content,
            )


class FrameDecoder(Protocol):
    """Makes raw blocks of frames; the seam to what knows DBC files."""

    def take(self, frames: FrameBatch) -> list[RawBlock]:
        """Decode the next frames of a log.

        Raises
        ------
        ConfigError
            If they cannot be those of the unit.
        """
        ...

    def flush(self) -> list[RawBlock]:
        """What is left at the end of the log."""
        ...
