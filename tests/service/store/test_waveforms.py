"""The index of waveform files: what there is, in which state, place by place."""

from dataclasses import replace

import pytest

from service.store.port import StoreError
from service.store.waveforms import WaveformFile, WaveformKind, WaveformState


def file(name: str, start_ns: int = 1, place: str = "here") -> WaveformFile:
    return WaveformFile(
        place=place,
        kind=WaveformKind.CONTINUOUS,
        name=name,
        unit="U1",
        start_ns=start_ns,
        stop_ns=start_ns + 5,
        n_samples=3000,
        n_bytes=2**40,
        checksum="ab" * 32,
        changed_ns=2**62,
        checked_ns=7,
    )


def test_what_was_put_comes_back_oldest_first_and_only_of_its_place(store):
    young, old, elsewhere = file("b", 20), file("a", 10), file("c", place="there")
    store.waveforms.put([young, old, elsewhere])

    assert store.waveforms.files("here") == [old, young]
    assert store.waveforms.files("there") == [elsewhere]


def test_a_capture_may_bear_the_name_of_a_continuous_recording(store):
    both = [file("a"), replace(file("a"), kind=WaveformKind.CAPTURE)]
    store.waveforms.put(both)

    assert sorted(store.waveforms.files("here"), key=lambda f: f.kind) == both[::-1]


def test_an_entry_is_replaced_and_one_of_what_was_removed_is_no_longer_there(store):
    damaged = replace(file("a"), state=WaveformState.DAMAGED, reason="a flipped bit")
    store.waveforms.put([file("a"), file("b")])
    store.waveforms.put([damaged, replace(file("b"), state=WaveformState.REMOVED)])

    assert store.waveforms.files("here") == [damaged]


def test_only_what_has_long_been_gone_is_forgotten(store):
    gone = replace(file("a"), state=WaveformState.MISSING, changed_ns=10)
    later = replace(file("b"), state=WaveformState.MISSING, changed_ns=30)
    there = replace(file("c"), changed_ns=10)
    store.waveforms.put([gone, later, there])

    assert store.waveforms.forget("here", 20) == 1
    assert store.waveforms.files("here") == [later, there]


def test_of_several_entries_all_are_written_or_none(store):
    with pytest.raises(StoreError):
        store.waveforms.put([file("a"), replace(file("b"), n_bytes=-1)])

    assert store.waveforms.files("here") == []
