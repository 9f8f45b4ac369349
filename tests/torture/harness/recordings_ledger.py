"""Continuous recordings beside what was offered: every sample is there once, or told as missing."""

import http.client
import re
from collections import Counter
from contextlib import closing
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from acquisition.errors import ConfigError
from acquisition.recordings.reader import Recording, open_recording
from harness.ledger_daq import Offered
from harness.ledger_plant import LedgerPlant
from harness.truth import Truth

PROMISED = re.compile(r"^padwatch_recording_samples_total ([0-9.e+]+)$", re.M)


@dataclass
class Recorded:
    """What is wrong with the recordings of a unit, and what is in them; per channel.

    Parameters
    ----------
    told
        Samples that they say are missing, by reason.
    longest_hole
        Most samples in a row that are missing.
    """

    wrong: list[str] = field(default_factory=list)
    n_samples: int = 0
    n_span: int = 0
    n_recordings: int = 0
    told: Counter[str] = field(default_factory=Counter)
    longest_hole: int = 0

    def table(self) -> str:
        """All of it for people."""
        told = ", ".join(f"{n} {reason}" for reason, n in sorted(self.told.items()))
        return (
            f"  {self.n_recordings} recordings, {self.n_samples} of {self.n_span} samples, missing"
            f" and told: {told or 'none'}; longest hole {self.longest_hole}"
        )


def promised(url: str) -> int:
    """Samples that the running service says are on the disk."""
    connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=30.0)
    with closing(connection):
        connection.request("GET", "/metrics")
        metrics = connection.getresponse().read().decode()
    return round(sum(map(float, PROMISED.findall(metrics))))


def recorded(root: Path, plant: LedgerPlant, unit: int, offered: Offered) -> Recorded:
    """Read all recordings of a unit, and compute every sample again."""
    found = Recorded()
    heads: list[tuple[int, int]] = []
    for folder in sorted(root.glob(f"{plant.units[unit - 1]}-*")):
        try:
            recording = open_recording(folder)
        except ConfigError as error:
            found.wrong.append(f"unreadable: {error}")
            continue
        found.n_recordings += 1
        heads += _compared(recording, plant, unit, found)
    _account(heads, offered.samples.get((plant.units[unit - 1], 1), 0), found)
    return found


def _compared(
    recording: Recording, plant: LedgerPlant, unit: int, found: Recorded
) -> list[tuple[int, int]]:
    """Return the first index and the number of samples of each block."""
    summary, heads = recording.summary, []
    for some, _ in recording.heads():
        heads += some[["first_index", "n_samples"]].tolist()
    found.told.update(summary.rejected)
    found.told["gap"] += summary.n_gap_samples
    for raw in recording.blocks():
        truth = Truth(plant.seed, unit, plant.rate_hz, raw.epoch)
        if not np.array_equal(raw.counts, truth.counts(raw.first_index, raw.n_samples)):
            found.wrong.append(f"altered: samples from {raw.first_index} on")
    return heads


def _account(heads: list[tuple[int, int]], n_offered: int, found: Recorded) -> None:
    heads.sort()
    for (first_index, n_samples), (next_index, _) in pairwise(heads):
        hole = next_index - first_index - n_samples
        found.longest_hole = max(found.longest_hole, hole)
        if hole < 0:
            found.wrong.append(f"duplicated: {-hole} samples from {next_index} on")
    found.n_samples = sum(n_samples for _, n_samples in heads)
    if not heads:
        return
    stop = sum(heads[-1])
    found.n_span = stop - heads[0][0]
    if stop > n_offered:
        found.wrong.append(f"unexpected: up to {stop}, offered were {n_offered}")
    if found.n_samples + found.told.total() != found.n_span:
        found.wrong.append(
            f"not accounted for: {found.n_span} passed, {found.n_samples} are there,"
            f" {found.told.total()} are told as missing"
        )
