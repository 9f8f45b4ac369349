"""`padwatch record`: the samples of one unit into a recording."""

import asyncio
import getpass
import os
import platform
import signal
import sys
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer
import uvloop

from acquisition.clock import SystemClock
from acquisition.errors import AcquisitionError
from acquisition.recording.writer import RecordingWriter
from acquisition.source import SampleSource
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.cli.units import UnitOption, one_unit
from service.wiring.recordings import recording_of, recording_writer
from service.wiring.sources import source_of

MAX_SECONDS = 7 * 86_400.0


def record(
    plant_file: PlantPath,
    out: Annotated[Path, typer.Option(help="Folder of the recording; must not exist yet.")],
    unit: UnitOption = None,
    seconds: Annotated[
        float, typer.Option(min=0.1, max=MAX_SECONDS, help="Length of the recording.")
    ] = 600.0,
    json_output: Annotated[
        bool, typer.Option("--json", help="Print the manifest instead of a sentence.")
    ] = False,
) -> None:
    """Record a unit's samples exactly as its DAQ delivers them.

    Ctrl-C and SIGTERM end the recording early and keep it. So does a lost link, with exit code 1.
    """
    settings = one_unit(read_plant_file(plant_file), unit, plant_file)
    try:
        writer = recording_writer(settings, out, _made_by())
        problem = uvloop.run(record_blocks(source_of(settings, SystemClock()), writer, seconds))
        manifest = recording_of(out).manifest
    except AcquisitionError as error:
        fail(f"padwatch record: {error}")
    if json_output:
        typer.echo(manifest.model_dump_json(indent=1))
    else:
        n_bytes = sum(file.size for file in manifest.files.values())
        typer.echo(
            f"{out}: {manifest.n_samples / manifest.rate_hz:.1f} s of unit {manifest.unit},"
            f" {len(manifest.channels)} channels, {n_bytes / 1e6:.1f} MB"
        )
    if problem:
        fail(f"padwatch record: ended early: {problem}")


async def record_blocks(
    source: SampleSource, writer: RecordingWriter, seconds: float
) -> str | None:
    """Record until enough has passed, SIGINT or SIGTERM comes, or the link is lost.

    Returns
    -------
    Why the link was lost, if it was.

    Raises
    ------
    AcquisitionError
        If nothing at all could be recorded; then nothing is left behind.
    """
    with writer:
        reading = asyncio.create_task(_read(source, writer, seconds))
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


async def _read(source: SampleSource, writer: RecordingWriter, seconds: float) -> None:
    on_terminal = sys.stderr.isatty()
    with typer.progressbar(
        length=round(seconds), label="Recording", file=sys.stderr, hidden=not on_terminal
    ) as bar:
        async with source.connect() as blocks:
            async for block in blocks:
                writer.write_calibrated(block)
                bar.update(round(min(writer.duration_s, seconds)) - bar.pos)
                if writer.duration_s >= seconds:
                    return


def _made_by() -> str:
    try:
        person = getpass.getuser()
    except (KeyError, OSError):  # a container's user need not have a name
        person = f"user {os.getuid()}"
    return f"padwatch {version('padwatch')}, {person} on {platform.node()}"[:200]
