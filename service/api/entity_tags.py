"""Entity tags (RFC 9110, 8.8.3): an answer's name, which is another as soon as there is news.

They are weak: what only time changes, an age or the present time, counts for nothing.
"""

import re
from hashlib import blake2b

_AGE = re.compile(rb'("(?:data_)?age_s":)[0-9][0-9.e+-]*')

_DIGEST_BYTES = 12


def digest_of(content: bytes) -> bytes:
    """Digest of a JSON text without the ages in it: fields ``age_s`` and ``data_age_s``."""
    if b'age_s":' in content:  # most answers have none, and looking is cheap
        content = _AGE.sub(rb"\1", content)
    return blake2b(content, digest_size=_DIGEST_BYTES).digest()


def tag_of(*digests: bytes) -> str:
    """The tag of an answer that consists of parts with these digests."""
    return f'W/"{blake2b(b"".join(digests), digest_size=_DIGEST_BYTES).hexdigest()}"'


def is_known(tag: str, if_none_match: str | None) -> bool:
    """Whether a client says that it has what a tag names.

    Parameters
    ----------
    if_none_match
        The header of that name: tags between commas, or a star for whatever there is.
    """
    if if_none_match is None:
        return False
    named = {each.strip().removeprefix("W/") for each in if_none_match.split(",")}
    return "*" in named or tag.removeprefix("W/") in named
