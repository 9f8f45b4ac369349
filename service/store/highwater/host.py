"""Which machine this is, as far as it can be told: a copied machine has the same store."""

import hashlib
from pathlib import Path

MACHINE_ID = Path("/etc/machine-id")
NO_HOST = ""


def host_id(machine_id: Path = MACHINE_ID) -> str:
    """Name of this machine, from which the machine's own cannot be found out.

    Empty where machines have none, as in many containers.
    """
    try:
        text = machine_id.read_bytes().strip()
    except OSError:
        return NO_HOST
    if not text or text == b"uninitialized":
        return NO_HOST
    return hashlib.blake2b(text, key=b"padwatch", digest_size=8).hexdigest()
