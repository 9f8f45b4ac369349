"""The memory of a unit as a document, and back."""

from pydantic import TypeAdapter, ValidationError

from service.measuring.analyser import VERSION, UnitMemory

_MEMORY = TypeAdapter(UnitMemory)


def written(memory: UnitMemory) -> bytes:
    """The memory as a document; floats come back to the last bit."""
    return _MEMORY.dump_json(memory)


def read(document: bytes) -> UnitMemory | None:
    """The memory that a document holds; None if it is not one of this version."""
    try:
        memory = _MEMORY.validate_json(document)
    except ValidationError:
        return None
    return memory if memory.version == VERSION else None
