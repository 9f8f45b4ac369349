"""Names and passwords: which are accepted, and how they are kept."""

import pytest
from argon2 import extract_parameters
from argon2.low_level import Type

from service.security.names import NameRefusedError, account_name
from service.security.passwords import (
    Hashing,
    PasswordRefusedError,
    new_password,
    plant_hasher,
)

GOOD = "rotor rope gauge"


def test_what_is_in_force_is_the_second_recommendation_of_rfc_9106() -> None:
    found = extract_parameters(plant_hasher().hash(GOOD))
    assert (found.type, found.version) == (Type.ID, 19)
    assert (found.time_cost, found.memory_cost, found.parallelism) == (3, 65_536, 4)
    assert (found.salt_len, found.hash_len) == (16, 32)


@pytest.mark.parametrize(
    ("password", "said"),
    [
        ("eleven char", "has 11"),
        ("x" * 257, "has 257"),
        ("ababababababab", "different characters"),
        ("aAaAbBbBcCcCdD", "different characters"),
        ("Operator of unit 3", "name of its account"),
        ("", "has 0"),
    ],
)
def test_a_poor_password_is_refused_and_not_repeated(password: str, said: str) -> None:
    with pytest.raises(PasswordRefusedError, match=said) as refused:
        new_password(password, "operator")
    assert not password or password not in str(refused.value)


def test_a_password_is_hashed_with_its_own_salt_however_its_letters_are_written(
    hashing: Hashing,
) -> None:
    one, other = hashing.hash(GOOD), hashing.hash(GOOD)
    assert one != other
    assert one.startswith("$argon2id$")
    assert hashing.verify(one, GOOD)
    assert not hashing.verify(one, GOOD + "s")
    composed, decomposed = "kalibrierschlüssel", "kalibrierschlu\u0308ssel"
    assert composed != decomposed
    assert hashing.verify(hashing.hash(composed), decomposed)
    long = "u\u0308" * 150 + "kalibr"  # of 306 code points, which are 156 characters
    assert hashing.verify(hashing.hash(new_password(long, "anna")), long)


def test_nothing_opens_an_account_that_is_not_there_or_whose_hash_is_damaged(
    hashing: Hashing,
) -> None:
    for password in ("", "\ud800", "x" * 1_000_000, "\0", "no account has this password"):
        assert not hashing.verify(None, password)
    for stored in ("", "!", "$argon2id$", "$argon2id$v=19$m=8,t=1,p=1$AAAA$AAAA"):
        assert not hashing.verify(stored, GOOD)


@pytest.mark.parametrize("name", ["anna", "a", "anna.b-c_d@plant", "7", "a" * 64])
def test_a_usual_name_is_accepted(name: str) -> None:
    assert account_name(f" {name.upper()} ") == name


@pytest.mark.parametrize(
    "name", ["", " ", ".a", "a.", "a b", "a\nb", "a\0b", "ä", "=cmd()", "<b>", "a" * 65, "key:x"]
)
def test_a_name_that_could_mean_something_else_is_refused(name: str) -> None:
    with pytest.raises(NameRefusedError, match="1 to 64"):
        account_name(name)
