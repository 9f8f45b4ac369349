"""Random tokens: shown to one holder once, stored only as digests."""

import re
import secrets
from hashlib import sha256

N_BYTES = 32
"""256 bits: a digest without salt or stretching is enough, nobody can guess through it."""

KEY_ID_BYTES = 6
TOKEN = re.compile(r"[A-Za-z0-9_-]{43}", re.ASCII)
KEY = re.compile(r"pw_([0-9a-f]{12})_[A-Za-z0-9_-]{43}", re.ASCII)


def new_token() -> str:
    """Draw a token for a session or for setting up."""
    return secrets.token_urlsafe(N_BYTES)


def new_key() -> tuple[str, str]:
    """Draw a key for a machine: its public id and the whole key, which begins with it."""
    id_ = secrets.token_hex(KEY_ID_BYTES)
    return id_, f"pw_{id_}_{secrets.token_urlsafe(N_BYTES)}"


def key_id(key: str) -> str | None:
    """Read the public id in a key; None if it is no key at all."""
    found = KEY.fullmatch(key)
    return found.group(1) if found else None


def is_token(text: str) -> bool:
    """Whether a text could be a token at all."""
    return TOKEN.fullmatch(text) is not None


def digest(token: str) -> bytes:
    """What is stored of a token."""
    return sha256(token.encode()).digest()


def is_token_of(token: str, stored: bytes) -> bool:
    """Whether a token has a stored digest, in a time that does not tell how nearly."""
    return secrets.compare_digest(digest(token), stored)
