"""`Identification`: who a device says it is."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Identification:
    """The basic objects of function 43/14; empty where the device gives none."""

    vendor: str
    product_code: str
    revision: str

    @classmethod
    def of_objects(cls, objects: Mapping[int, bytes]) -> "Identification":
        """Build from objects 0 to 2 as they were read; what is not ASCII is shown escaped."""
        texts = (objects.get(number, b"") for number in range(3))
        return cls(*(text.decode("ascii", "backslashreplace").strip("\0 ") for text in texts))
