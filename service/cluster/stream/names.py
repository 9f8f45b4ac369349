"""What things are called on the servers."""

import re

from core.samples.blocks import SampleBlock
from service.cluster.stream.identity import UnitIdentity, fingerprint
from service.settings.plant import PlantFile
from service.settings.units import UnitSettings

ROOT = "padwatch"


def plant_mark(plant: PlantFile) -> bytes:
    """Fingerprint of a plant."""
    return fingerprint(ROOT, plant.plant.name)


def stream_name(plant: PlantFile) -> str:
    """Name of the plant's stream: legible, and unlike that of any other plant."""
    if plant.stream is not None and plant.stream.name is not None:
        return plant.stream.name
    legible = re.sub(r"[^A-Za-z0-9]+", "-", plant.plant.name).strip("-")[:32]
    return "-".join(part for part in (ROOT, legible, plant_mark(plant).hex()[:8]) if part)


def subjects(plant: PlantFile) -> str:
    """Subjects of all units of a plant."""
    return f"{ROOT}.{stream_name(plant)}.*"


def subject(plant: PlantFile, unit: str) -> str:
    """Subject of a unit; a dot in its id would part the subject."""
    return f"{ROOT}.{stream_name(plant)}.{unit.replace('.', '=')}"


def consumer_name(unit: str) -> str:
    """What a unit's analysis is called on the servers."""
    return f"analyse-{unit.replace('.', '=')}"


def message_id(identity: UnitIdentity, block: SampleBlock) -> str:
    """The same for the same block, however often it is published, and for no other.

    Its time tells it from one of a device that counts the same indices anew.
    """
    place = f"{block.epoch}.{block.first_index}.{block.start_ns}"
    return f"{identity.plant.hex()[:8]}.{block.unit}.{place}"


def identity_of(plant: PlantFile, unit: UnitSettings) -> UnitIdentity:
    """What the blocks of a unit must be marked with."""
    channels = [(channel.id, str(channel.measurand)) for channel in unit.channel]
    make = fingerprint(unit.id, unit.sampling_hz, unit.source.kind, channels)
    return UnitIdentity(unit.id, plant_mark(plant), make)
