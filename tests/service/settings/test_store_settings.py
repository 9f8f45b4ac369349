"""Where results are kept, as the plant file says it."""

from collections.abc import Callable

import pytest

ADDRESS = "host=db.plant.example dbname=padwatch user=padwatch"


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        (
            'password_file = "secret"',
            "store.password_file = 'secret': is for postgresql, which is not given",
        ),
        (f'postgresql = "{ADDRESS} password=x"', "store.postgresql: must not hold a password"),
        (
            'postgresql = "postgresql://padwatch:x@db.plant.example/padwatch"',
            "store.postgresql: must not hold a password",
        ),
        ('postgresql = "no address"', "store.postgresql: is no connection string of libpq"),
        ('postgresql = "hostname=x"', "store.postgresql: is no connection string of libpq"),
        (
            f'postgresql = "{ADDRESS} passfile=x"\npassword_file = "y"',
            "store.password_file = 'y': is given as well as passfile",
        ),
    ],
)
def test_an_address_that_cannot_be_used_is_refused_and_no_password_is_shown(
    mistakes: Callable[[str], list[str]], plant_text: str, lines: str, complaint: str
) -> None:
    (told,) = mistakes(f"{plant_text}\n[store]\n{lines}\n")

    assert complaint in told
    assert "password=x" not in told
    assert ":x@" not in told
