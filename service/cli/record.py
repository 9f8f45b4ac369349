"""`padwatch record`: record the samples of one unit."""

import asyncio
import random
import signal
from contextlib import nullcontext, suppress
from typing import Annotated

import typer
import uvloop

from acquisition.clock import Clock, SystemClock
from acquisition.errors import AcquisitionError, LinkError
from acquisition.recordings.reader import open_recording
from acquisition.recordings.writer import RecordingWriter
from acquisition.source import SampleSource
from service.app.recordings import recording_writer
from service.app.storage import database_path
from service.cli.options import (
    JsonOutput,
    NewRecording,
    PlantPath,
    UnitOption,
    fail,
    one_unit,
    print_result,
    progress,
)
from service.measuring.sources import source_of
from service.runtime.process import made_by
from service.settings.plant import load_plant_file
from service.settings.sources.devices import ModbusFifoSettings, ModbusVectorSettings
from service.store.holds import exclusive_use

MAX_SECONDS = 7 * 86_400.0

RETRY_S = 0.5
"""Maximum delay before a lost link is reopened, as in the service."""


def record(
    plant_file: PlantPath,
    out: NewRecording,
    unit: UnitOption = None,
    seconds: Annotated[
        float, typer.Option(min=0.1, max=MAX_SECONDS, help="Length of the recording.")
    ] = 600.0,
    reconnect: Annotated[
        bool, typer.Option("--reconnect", help="Continue after a lost link, with a gap.")
    ] = False,
    json_output: JsonOutput = False,
) -> None:
    """Record a unit's samples exactly as its DAQ delivers them.

    Ctrl-C and SIGTERM end the recording early and keep it. So does a lost link, with exit code 1,
    unless --reconnect is given: then the recording ends when its length has passed. Refused for a
    device whose queue is emptied by reading, while the service of the plant file runs.
    """
    plant = load_plant_file(plant_file)
    settings = one_unit(plant, unit, plant_file)
    if isinstance(settings.source, ModbusVectorSettings):
        words = 'a source of kind "modbus_vector" reports vectors instead of samples'
        fail(f"unit {settings.id} cannot be recorded: {words}", code=2)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fail(f"{out.parent}: {error.strerror}")
    writer = recording_writer(settings, out, made_by())
    clock = SystemClock()
    policy = ReconnectPolicy(seconds, clock) if reconnect else None
    queue = isinstance(settings.source, ModbusFifoSettings) and settings.source.reading == "removes"
    # a running service would lose the samples that are taken from a queue
    with exclusive_use(database_path(plant)) if queue else nullcontext():
        problem = uvloop.run(record_blocks(source_of(settings, clock), writer, seconds, policy))
    manifest = open_recording(out).manifest
    n_bytes = sum(file.size for file in manifest.files.values())
    line = (
        f"{out}: {manifest.n_samples / manifest.rate_hz:.1f} s of unit {manifest.unit},"
        f" {len(manifest.channels)} channels, {n_bytes / 1e6:.1f} MB"
    )
    print_result(manifest, [line], json_output)
    if problem:
        fail(f"recording ended early: {problem}")


class ReconnectPolicy:
    """Delay before each attempt to reopen a lost link; no attempts after the planned end.

    Parameters
    ----------
    seconds
        Planned length of the recording from now on, s.
    """

    def __init__(self, seconds: float, clock: Clock) -> None:
        self._clock = clock
        self._deadline_s = clock.monotonic_s() + seconds

    async def wait(self, error: LinkError) -> None:
        """Sleep for 0.5 to 1 times `RETRY_S`, at random; raise `error` after the planned end."""
        if self._clock.monotonic_s() >= self._deadline_s:
            raise error
        # a random share, as in the service, so that many recorders do not connect at once
        await self._clock.sleep(RETRY_S * random.uniform(0.5, 1.0))  # noqa: S311  not a secret


async def record_blocks(
    source: SampleSource,
    writer: RecordingWriter,
    seconds: float,
    policy: ReconnectPolicy | None = None,
) -> str | None:
    """Record until the length has passed, SIGINT or SIGTERM arrives, or the link is lost.

    Installs handlers of both signals, and closes the writer.

    Parameters
    ----------
    seconds
        Length of the recording, s.
    policy
        Delay before a lost link is reopened; None ends the recording when the link is lost.

    Returns
    -------
    str or None
        Reason why the link was lost; None if it was not.

    Raises
    ------
    AcquisitionError
        If nothing could be recorded; no files remain.
    """
    with writer:
        reading = asyncio.create_task(_read(source, writer, seconds, policy))
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, reading.cancel)
        try:
            with suppress(asyncio.CancelledError):
                await reading
        except AcquisitionError as error:
            if writer.n_samples == 0:
                raise
            return str(error)
    return None


async def _read(
    source: SampleSource,
    writer: RecordingWriter,
    seconds: float,
    policy: ReconnectPolicy | None,
) -> None:
    with progress("Recording", round(seconds)) as bar:
        while writer.duration_s < seconds:
            try:
                async with source.connect() as blocks:
                    async for block in blocks:
                        writer.write(block)
                        bar.update(round(min(writer.duration_s, seconds)) - bar.pos)
                        if writer.duration_s >= seconds:
                            break
                    else:
                        return  # the source has ended
            except LinkError as error:
                if policy is None:
                    raise
                await policy.wait(error)
