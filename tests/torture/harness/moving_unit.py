"""A unit's analysis as `padwatch analyse` does it, moved as often as wanted, without a server."""

from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.clock import Clock, SystemClock
from harness.stream_rig import analysis_of
from service.app.analysis import Analysis
from service.cluster.progress import UnitProgress, memories_of, usable
from service.cluster.session import identity_of
from service.settings.plant import PlantFile, load_plant_file
from service.store.sqlite import SqliteStore

STREAM = "born once"

Message = tuple[int, bytes]
"""Its number on the stream, and its bytes."""


@dataclass
class Life:
    """An analysis from its start to its end."""

    analysis: Analysis
    progress: UnitProgress

    async def take(self, messages: Sequence[Message], rng: np.random.Generator) -> None:
        """Take messages in, in batches as the consumer does; the store may be faster than that."""
        end = rng.integers(1, 9)
        for number, (sequence, payload) in enumerate(messages):
            await self.progress.take(sequence, payload)
            if number == end:
                end += rng.integers(1, 9)
                await self.store()
            elif rng.random() < 0.3:
                await self.analysis.recorder.flush()

    async def store(self) -> None:
        """Store everything, with how far it is."""
        if not self.progress.is_replaying:
            self.analysis.recorder.put([self.progress.position()])
        await self.analysis.recorder.flush()

    async def close(self) -> None:
        """Let go of all files and threads, storing nothing more."""
        await self.analysis.captures.close()
        await self.analysis.evidence.close()
        await self.analysis.tape.close()
        self.analysis.recordings.close()


class MovingUnit:
    """The only unit of a plant.

    Parameters
    ----------
    plant_file
        Its data folder holds the database.
    clock
        The host's own if none is given.
    """

    def __init__(self, plant_file: Path, clock: Clock | None = None) -> None:
        self._clock = clock or SystemClock()
        self.plant: PlantFile = load_plant_file(plant_file)
        self.database = Path(self.plant.service.data_folder) / "padwatch.sqlite3"
        self.identity = identity_of(self.plant, self.plant.unit[0])

    async def live(
        self, messages: Sequence[Message], n: int | None, rng: np.random.Generator
    ) -> Counter[str]:
        """Start anew where the database says, take messages in, and be killed after `n` of them.

        Parameters
        ----------
        n
            All of them, and an end in good order, where it is None.

        Returns
        -------
        How many messages were refused, by reason.
        """
        with ExitStack() as stack:
            life = await self.begun(messages[-1][0], stack)
            life.progress.reaches_back(messages[0][0])
            wanted = [each for each in messages if each[0] >= life.progress.first_needed]
            await life.take(wanted[:n], rng)
            if n is None:
                await life.store()
            await life.close()
            return life.progress.refused

    async def begun(self, newest: int, stack: ExitStack) -> Life:
        """Start anew where the database says; the stack closes the database.

        Parameters
        ----------
        newest
            Number of the newest message on the stream.
        """
        clock, unit = self._clock, self.plant.unit[0]
        store = stack.enter_context(closing(SqliteStore(self.database)))
        found = store.position(unit.id)
        memories = memories_of([found] if found else [])
        analysis = analysis_of(self.plant, clock, store)
        await analysis.start(memories)
        parts = (analysis.analyser, analysis.live, analysis.recorder, clock)
        stored, memory = usable(found, STREAM, newest), memories.get(unit.id)
        done = store.reach(unit.id) if stored is None else None
        return Life(analysis, UnitProgress(self.identity, STREAM, stored, memory, *parts, done))
