import struct
import tracemalloc
import zlib
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rigs.blocks import with_quality

from core.quality import GOOD, Reason, bad
from core.samples.blocks import SampleBlock, joined
from service.cluster.frames import (
    Taken,
    UnitIdentity,
    WireError,
    decoded,
    encoded_block,
    encoded_link,
    fingerprint,
)
from service.live.status import LinkState
from service.measuring.acquirer import LinkNews

OWN = UnitIdentity("U1", fingerprint("Plant"), fingerprint("sx"))
TAKEN_NS = 1_767_225_600_000_000_007


def assert_same(found: object, sent: SampleBlock) -> None:
    assert isinstance(found, SampleBlock)
    for field in fields(SampleBlock):
        if field.name not in ("counts", "side"):
            assert getattr(found, field.name) == getattr(sent, field.name), field.name
    assert found == SampleBlock(**{f.name: getattr(sent, f.name) for f in fields(SampleBlock)})


def with_crc(body: bytes) -> bytes:
    return body + struct.pack("<I", zlib.crc32(body))


def test_a_block_comes_back_bit_for_bit(block, identity):
    bad_block = replace(with_quality(block, (bad(Reason.DEAD), GOOD)), elsewhere={}, clock=None)
    pieces = [block.from_sample(7, 20), block.from_sample(20, 33)]
    counts = [
        replace(one, counts=one.first_index % 2**15 + np.arange(26, dtype=np.int16).reshape(2, 13))
        for one in pieces
    ]
    in_cells = joined(counts)
    for sent in (block, bad_block, block.from_sample(7, 9), block.from_sample(60), in_cells):
        found = decoded(encoded_block(sent, identity, TAKEN_NS), identity)
        assert isinstance(found, Taken)
        assert found.taken_ns == TAKEN_NS
        assert_same(found.block, sent)


def test_news_of_a_link_come_back(identity):
    for news in (
        LinkNews("U1", LinkState.CONNECTED),
        LinkNews("U1", LinkState.NOT_CONNECTED, "10.0.0.7 refuses: “no”"),
    ):
        assert decoded(encoded_link(news, identity), identity) == news


def test_a_flipped_bit_anywhere_is_noticed(block, identity):
    message = encoded_block(block, identity, TAKEN_NS)
    for at in range(0, 8 * len(message), 5):
        hurt = bytearray(message)
        hurt[at // 8] ^= 1 << at % 8
        with pytest.raises(WireError):
            decoded(bytes(hurt), identity)


def test_a_message_that_was_cut_or_grew_is_refused(block, identity):
    message = encoded_block(block, identity, TAKEN_NS)
    for hurt in (b"", message[:3], message[:50], message[:-1], message + b"\0", message * 2):
        with pytest.raises(WireError) as refused:
            decoded(hurt, identity)
        assert refused.value.kind in ("not_a_message", "wrong_length")


@pytest.mark.parametrize(
    ("other", "kind", "word"),
    [
        ({"plant": fingerprint("Elsewhere")}, "other_plant", "one stream"),
        ({"make": fingerprint("sx", "sz")}, "other_configuration", "same plant file"),
        ({"unit": "U2"}, "other_unit", "unit U1"),
    ],
)
def test_a_message_of_somebody_else_is_refused_with_what_to_do(block, identity, other, kind, word):
    message = encoded_block(block, identity, TAKEN_NS)
    with pytest.raises(WireError, match=word) as refused:
        decoded(message, replace(identity, **other))
    assert refused.value.kind == kind


@pytest.mark.parametrize(
    ("place", "number", "kind", "words"),
    [(4, 9, "other_version", "version 9.*upgrade `padwatch"), (6, 77, "unknown_kind", "77")],
)
def test_a_message_of_a_later_version_asks_for_an_upgrade_and_an_unknown_kind_is_refused(
    block, identity, place, number, kind, words
):
    message = bytearray(encoded_block(block, identity, TAKEN_NS)[:-4])
    message[place : place + 2] = struct.pack("<H", number)
    with pytest.raises(WireError, match=words) as refused:
        decoded(with_crc(bytes(message)), identity)
    assert refused.value.kind == kind


def forged(head: bytes, samples: bytes, kind: int = 1) -> bytes:
    start = struct.pack(
        "<4sHH16s16sII", b"PWSM", 2, kind, OWN.plant, OWN.make, len(head), len(samples)
    )
    return with_crc(start + head + samples)


@given(st.binary(max_size=400), st.binary(max_size=40), st.sampled_from([1, 2]))
@settings(max_examples=150, deadline=None)
def test_hostile_bytes_within_a_good_frame_are_refused(head, samples, kind):
    with pytest.raises(WireError):
        decoded(forged(head, samples, kind), OWN)


@given(st.binary(max_size=2000))
@settings(max_examples=150, deadline=None)
def test_hostile_bytes_are_refused(message):
    with pytest.raises(WireError):
        decoded(message, OWN)


def test_a_message_that_claims_much_takes_little_memory(block):
    whole = encoded_block(with_quality(block, (GOOD, GOOD)), OWN, TAKEN_NS)
    (n_head,) = struct.unpack_from("<I", whole, 40)
    head = whole[48 : 48 + n_head].replace(b'"n_samples":60', b'"n_samples":9223372036854775807')
    deep = b"[" * 100_000
    lying = struct.pack("<4sHH16s16sII", b"PWSM", 2, 1, OWN.plant, OWN.make, 2**32 - 1, 2**32 - 1)
    tracemalloc.start()
    try:
        for hurt in (forged(head, b"\0" * 480), forged(deep, b""), with_crc(lying)):
            with pytest.raises(WireError):
                decoded(hurt, OWN)
        assert tracemalloc.get_traced_memory()[1] < 2_000_000
    finally:
        tracemalloc.stop()


def test_samples_travel_little_endian_and_row_by_row_however_they_lie(block, identity):
    turned = replace(block, counts=np.asfortranarray(block.counts))
    assert encoded_block(turned, identity, TAKEN_NS) == encoded_block(block, identity, TAKEN_NS)
