"""The wire format: blocks and news of links as bytes, and back, bit for bit."""

from dataclasses import dataclass
from typing import Annotated, TypeVar

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from core.quality import Quality, Reading
from core.samples.blocks import DeviceClock, Rejection, SampleBlock, StampFault
from service.cluster.stream.frame import Frame, Kind, framed, unframed
from service.cluster.stream.identity import UnitIdentity
from service.cluster.stream.wire_errors import WireError
from service.live.live_view import LinkState
from service.measuring.link_news import LinkNews

SAMPLE = np.dtype("<f4")

Epoch = Annotated[int, Field(ge=0, lt=2**63)]
Index = Annotated[int, Field(ge=0, lt=2**53)]
"""Exact in recordings, too, where numbers are doubles."""

Ns = Annotated[int, Field(ge=-(2**62), lt=2**62)]
"""From 1823 to 2116, so that nothing that is worked out from it overflows in a database."""

T = TypeVar("T")

STRICT = ConfigDict(extra="forbid", ser_json_inf_nan="constants")


@dataclass(frozen=True)
class BlockHead:
    """All of a block but its samples."""

    __pydantic_config__ = STRICT

    unit: str
    epoch: Epoch
    first_index: Index
    start_ns: Ns
    rate_hz: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    n_samples: Index
    channel_quality: tuple[Quality, ...]
    slow: dict[str, Reading]
    rejected: tuple[Rejection, ...]
    clock: DeviceClock | None
    stamp_fault: StampFault | None
    taken_ns: Ns


@dataclass(frozen=True)
class LinkHead:
    """News of a link."""

    __pydantic_config__ = STRICT

    unit: str
    state: LinkState
    reason: str | None


_BLOCK, _LINK = TypeAdapter(BlockHead), TypeAdapter(LinkHead)


@dataclass(frozen=True)
class Taken:
    """A block with when it was taken from its device.

    Parameters
    ----------
    taken_ns
        When its device had its last sample, by the clock of the host that acquires: how far behind
        the analysis is.
    """

    block: SampleBlock
    taken_ns: int


def encoded_block(block: SampleBlock, identity: UnitIdentity, taken_ns: int) -> bytes:
    """A block as a message. Raises `ValueError` if it is longer than a reader takes."""
    head = BlockHead(
        unit=block.unit,
        epoch=block.epoch,
        first_index=block.first_index,
        start_ns=block.start_ns,
        rate_hz=block.rate_hz,
        n_samples=block.n_samples,
        channel_quality=block.channel_quality,
        slow=dict(block.slow),
        rejected=block.rejected,
        clock=block.clock,
        stamp_fault=block.stamp_fault,
        taken_ns=taken_ns,
    )
    samples = np.ascontiguousarray(block.samples, dtype=SAMPLE).tobytes()
    return framed(Kind.BLOCK, identity, _BLOCK.dump_json(head), samples)


def encoded_link(news: LinkNews, identity: UnitIdentity) -> bytes:
    """News of a link as a message."""
    head = LinkHead(news.unit, news.state, None if news.reason is None else news.reason[:1000])
    return framed(Kind.LINK, identity, _LINK.dump_json(head))


def decoded(message: bytes, identity: UnitIdentity) -> Taken | LinkNews:
    """What a message says.

    Parameters
    ----------
    identity
        Of the unit that it must be of.

    Raises
    ------
    WireError
        If it cannot be used; never anything else, whatever the bytes are.
    """
    frame = unframed(message, identity)
    if frame.kind is Kind.LINK:
        link = _read(_LINK, frame.head)
        _require_own(link.unit, identity)
        return LinkNews(link.unit, link.state, link.reason)
    return _block(frame, identity)


def _block(frame: Frame, identity: UnitIdentity) -> Taken:
    head = _read(_BLOCK, frame.head)
    _require_own(head.unit, identity)
    n_channels = len(head.channel_quality)
    if n_channels * head.n_samples * SAMPLE.itemsize != len(frame.samples):
        raise WireError(
            "wrong_length",
            f"{len(frame.samples)} bytes of samples for {n_channels} channels of {head.n_samples}",
        )
    samples = np.frombuffer(frame.samples, dtype=SAMPLE).reshape(n_channels, head.n_samples)
    block = SampleBlock(
        unit=head.unit,
        epoch=head.epoch,
        first_index=head.first_index,
        start_ns=head.start_ns,
        rate_hz=head.rate_hz,
        samples=samples.astype(np.float32, copy=False),
        channel_quality=head.channel_quality,
        slow=head.slow,
        rejected=head.rejected,
        clock=head.clock,
        stamp_fault=head.stamp_fault,
    )
    return Taken(block, head.taken_ns)


def _read(adapter: TypeAdapter[T], head: bytes) -> T:
    try:
        return adapter.validate_json(head)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        message = f"a message whose head is not understood: {where}: {first['msg']}"
        raise WireError("not_understood", message) from None


def _require_own(unit: str, identity: UnitIdentity) -> None:
    if unit != identity.unit:
        raise WireError(
            "other_unit", f"a message of unit {unit!r} among those of {identity.unit!r}"
        )
