"""Bytes of recordings that change on the disk: right samples or a refusal, never wrong samples."""

from typing import Any

import numpy as np
import pytest
from harness.corruption import CHANGES, corrupted

from acquisition.errors import ConfigError
from service.recordings.shelf import Shelf
from service.store.waveform_port import WaveformKind, WaveformState


def test_nothing_of_a_recording_that_is_known_to_be_damaged_is_handed_out(rig: Any) -> None:
    folder = rig.make(0)
    shelf = Shelf((rig.roots[WaveformKind.CONTINUOUS],), {folder.name: "a bit has flipped"})

    for read in (shelf.opened, shelf.summary, shelf.zip_pieces):
        with pytest.raises(ConfigError, match="a bit has flipped"):
            read(folder.name)
    with pytest.raises(ConfigError, match="a bit has flipped"):
        next(shelf.csv_pieces(folder.name))
    kept = shelf.one(folder.name)
    assert kept is not None
    assert kept.fault == "a bit has flipped"


def test_every_damage_is_noticed_when_the_recording_is_read_once_more(rig: Any) -> None:
    folder = rig.make(0)
    rig.caretaker.look()
    [entry] = rig.files()
    rng = np.random.default_rng(7)
    for path in sorted(folder.iterdir()):
        whole = path.read_bytes()
        for damage in CHANGES:
            path.write_bytes(corrupted(whole, damage, rng))
            assert rig.caretaker.check(entry).state is WaveformState.DAMAGED, (path.name, damage)
        path.write_bytes(whole)
    assert rig.caretaker.check(entry).state is WaveformState.PRESENT
