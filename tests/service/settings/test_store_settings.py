"""Where results are kept, as the plant file says it."""

from collections.abc import Callable

import pytest

ADDRESS = "host=db.plant.example dbname=padwatch user=padwatch"
BOTH = f'postgresql = "{ADDRESS} passfile=x"\npassword_file = "y"'


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        ('password_file = "x"', "password_file = 'x': is for postgresql, which is not given"),
        (f'postgresql = "{ADDRESS} password=x"', "postgresql: must not hold a password"),
        ('postgresql = "postgresql://a:x@b.c/d"', "postgresql: must not hold a password"),
        ('postgresql = "no address"', "postgresql: is no connection string of libpq"),
        ('postgresql = "hostname=x"', "postgresql: is no connection string of libpq"),
        (BOTH, "password_file = 'y': is given as well as passfile"),
    ],
)
def test_an_address_that_cannot_be_used_is_refused_and_no_password_is_shown(
    mistakes: Callable[[str], list[str]], plant_text: str, lines: str, complaint: str
) -> None:
    (told,) = mistakes(f"{plant_text}\n[store]\n{lines}\n")

    assert f"store.{complaint}" in told
    assert "password=x" not in told
    assert ":x@" not in told
