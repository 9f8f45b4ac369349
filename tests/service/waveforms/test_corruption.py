"""Bytes of recordings that change on the disk: right samples or a refusal, never wrong samples."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigs.tiers import fast_and_long

from acquisition.errors import ConfigError
from acquisition.recordings.reader import open_recording
from acquisition.recordings.summary import summary_of
from service.recordings.shelf import Shelf
from service.store.waveform_port import WaveformKind, WaveformState

Damage = Callable[[bytearray, np.random.Generator], None]


def flipped_bit(content: bytearray, rng: np.random.Generator) -> None:
    content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))


def zeroed_sector(content: bytearray, rng: np.random.Generator) -> None:
    start = int(rng.integers(len(content)))
    stop = min(len(content), start + 512)
    if not any(content[start:stop]):
        content[start] = 1
    else:
        content[start:stop] = bytes(stop - start)


def cut_off(content: bytearray, rng: np.random.Generator) -> None:
    del content[int(rng.integers(len(content))) :]


def exchanged_bytes(content: bytearray, rng: np.random.Generator) -> None:
    start = int(rng.integers(len(content)))
    content[start : start + 8] = rng.bytes(8)


DAMAGES: tuple[Damage, ...] = (flipped_bit, zeroed_sector, cut_off, exchanged_bytes)


def content_of(folder: Path) -> tuple[object, ...]:
    """All that anybody is told of the samples in a recording."""
    recording = open_recording(folder)
    blocks = list(recording.raw_blocks())
    counts = np.concatenate([block.counts for block in blocks], axis=1).tobytes()
    heads = [(b.epoch, b.first_index, b.start_ns, b.ok, b.slow) for b in blocks]
    return recording.manifest, counts, heads, summary_of(recording).n_samples


@pytest.fixture
def damaged(tmp_path: Path, make_recording: Any) -> Callable[[np.random.Generator], Path]:
    """Copies a recording and spoils one of its files."""
    whole = make_recording(tmp_path / "whole", 1_767_225_600_000_000_000)

    def spoil(rng: np.random.Generator) -> Path:
        copy = tmp_path / "damaged" / "U1-20260101T000000.000Z-continuous"
        shutil.rmtree(copy.parent, ignore_errors=True)
        shutil.copytree(whole, copy)
        path = sorted(copy.iterdir())[int(rng.integers(3))]
        content = bytearray(path.read_bytes())
        DAMAGES[int(rng.integers(len(DAMAGES)))](content, rng)
        path.write_bytes(content)
        return copy

    return spoil


@pytest.mark.parametrize("n_seeds", fast_and_long(200, 3000))
def test_no_damage_gives_a_wrong_sample(
    damaged: Callable[[np.random.Generator], Path], tmp_path: Path, n_seeds: int
) -> None:
    truth, n_refused = content_of(tmp_path / "whole"), 0
    for seed in range(n_seeds):
        folder = damaged(np.random.default_rng(seed))
        try:
            found = content_of(folder)
        except ConfigError:
            n_refused += 1
        else:
            assert found == truth, f"seed {seed}"
    assert n_refused > 0.9 * n_seeds


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
        for damage in DAMAGES:
            content = bytearray(whole)
            damage(content, rng)
            path.write_bytes(content)
            assert rig.caretaker.check(entry).state is WaveformState.DAMAGED, (path.name, damage)
        path.write_bytes(whole)
    assert rig.caretaker.check(entry).state is WaveformState.PRESENT
