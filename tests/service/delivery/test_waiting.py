"""How long to wait between attempts, and secrets that cannot be read."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.delivery.backoff import wait_s
from service.delivery.secret import Secret, SecretError

SHARES = st.floats(0.0, 1.0)
LONGEST_S = st.floats(1.0, 86_400.0)


@given(n=st.integers(1, 10**6), share=SHARES, longest_s=LONGEST_S, asked_s=st.floats(0.0, 1e12))
def test_a_wait_is_never_longer_than_its_limit_nor_shorter_than_half_a_second(
    n: int, share: float, longest_s: float, asked_s: float
) -> None:
    waited_s = wait_s(n, asked_s, longest_s, lambda: share)

    assert 0.5 <= waited_s <= longest_s
    assert waited_s >= min(asked_s, longest_s)


@given(n=st.integers(1, 20), share=SHARES)
def test_no_wait_is_shorter_than_one_before_it_could_have_been(n: int, share: float) -> None:
    assert wait_s(n + 1, None, 1e9, lambda: 1.0) >= wait_s(n, None, 1e9, lambda: share) * 0.999


def test_a_secret_loses_the_end_of_its_line_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "key").write_text("s3cret with spaces\r\n")

    assert Secret(tmp_path / "key").read() == "s3cret with spaces"


@pytest.mark.parametrize("content", [None, b"", b"\n", b"a\nb", b"\xff\xfe", b"a\x00b"])
def test_what_is_no_line_of_text_is_refused_without_being_shown(
    content: bytes | None, tmp_path: Path
) -> None:
    if content is not None:
        (tmp_path / "key").write_bytes(content)

    with pytest.raises(SecretError, match="No such file" if content is None else None) as refusal:
        Secret(tmp_path / "key").read()
    assert str(tmp_path / "key") in str(refusal.value)
