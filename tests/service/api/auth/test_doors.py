"""Who is let in, for how long, and what ends it."""

import sqlite3
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest
from pydantic import ValidationError
from rigs.standing_clock import T0, at

from service.api.auth.authenticator import Authenticator
from service.api.auth.backoff import ACCOUNT_FREE
from service.api.auth.passwords import Hashing
from service.api.problems import ProblemError
from service.app.listener import ClosedError, require_protected
from service.settings.plant import ServiceSettings
from service.settings.processes import TlsSettings
from service.store.access.identities import Identity, Means, Permission, Role, SessionLimits, digest
from service.store.access.tables import MAX_SESSIONS
from service.store.port import StoreError

S = 1_000_000_000
H = 3600 * S
PASSWORD = "rotor rope gauge"  # noqa: S105
HERE = "10.0.0.1"


@pytest.fixture
def anna(doors: Authenticator) -> str:
    return doors.add("anna", Role.OPERATOR, PASSWORD)


def log_in(
    doors: Authenticator, now_ns: int = T0, name: str = "anna", password: str = PASSWORD
) -> str:
    return at(doors, now_ns).log_in(name, password, HERE).token


def refused(doors: Authenticator, name: str, password: str) -> int:
    """Status of a failed login."""
    with pytest.raises(ProblemError) as error:
        doors.log_in(name, password, HERE)
    return error.value.status


def test_the_right_password_opens_and_its_token_says_who_it_is(doors, anna):
    found = doors.log_in(" Anna ", PASSWORD, HERE)

    assert found.identity == Identity(anna, Role.OPERATOR, Means.SESSION)
    assert at(doors, T0 + S).person(found.token) == found.identity
    assert found.token not in repr(found)


def test_a_wrong_name_is_refused_as_a_wrong_password_and_costs_as_many_hashes(doors, anna, hasher):
    wrong = ((anna, "rotor rope gaug"), ("ann", PASSWORD), ("no name at all", PASSWORD))
    for n, (name, password) in enumerate(wrong, 1):
        assert refused(doors, name, password) == 401
        assert vars(hasher)["n_verified"] == n
    for name, password in ((anna, ""), ("", ""), ("\ud800", "\ud800")):
        assert refused(doors, name, password) == 401


@pytest.mark.usefixtures("anna")
def test_neither_password_nor_token_nor_key_is_in_the_database(doors, path):
    token = log_in(doors)
    _, key = doors.create_key("historian", Role.VIEWER, (), 30)
    with closing(sqlite3.connect(path)) as connection:
        stored = "\n".join(connection.iterdump())
    files = b"".join(file.read_bytes() for file in path.parent.glob("padwatch.sqlite3*"))

    assert digest(token).hex().upper() in stored.upper()
    for secret in (PASSWORD, token, key):
        assert secret not in stored
        assert secret.encode() not in files


@pytest.mark.usefixtures("anna")
def test_a_login_ends_half_an_hour_after_its_last_use(doors):
    token, now_ns = log_in(doors), T0
    for _ in range(10):
        now_ns += 29 * 60 * S
        assert isinstance(at(doors, now_ns).person(token), Identity)
    assert at(doors, now_ns + 30 * 60 * S).person(token) is None
    assert at(doors, now_ns).person(token) is None  # it is over, not only late


@pytest.mark.usefixtures("anna")
def test_a_login_ends_twelve_hours_or_as_set_after_it_began_in_any_case(doors, access, hashing):
    token = log_in(doors)
    for quarter in range(1, 48):
        assert isinstance(at(doors, T0 + quarter * H // 4).person(token), Identity)
    assert at(doors, T0 + 12 * H).person(token) is None
    limits = SessionLimits(idle_s=60.0, absolute_s=120.0)
    doors = Authenticator(access, doors.clock, hashing=hashing, limits=limits)
    token = log_in(doors)
    assert at(doors, T0 + 60 * S).person(token) is None


@pytest.mark.usefixtures("anna")
def test_a_clock_put_right_by_years_ends_a_login_and_by_a_minute_does_not(doors):
    for ahead_ns, kind in ((9000 * H, type(None)), (60 * S, Identity)):
        token = log_in(doors, T0 + ahead_ns)
        assert isinstance(at(doors, T0).person(token), kind)


@pytest.mark.usefixtures("anna")
def test_a_use_is_written_once_a_minute(doors, access):
    token, seen = log_in(doors), set()
    for second in range(180):
        at(doors, T0 + second * S).person(token)
        found = access.sessions.get(digest(token))
        assert found is not None
        seen.add(found[0].seen_ns)
    assert sorted(seen) == [T0, T0 + 60 * S, T0 + 120 * S]


@pytest.mark.usefixtures("anna")
async def test_logging_out_ends_this_login_and_no_other_and_a_forged_token_opens_nothing(doors):
    here, there = log_in(doors), log_in(doors)
    await doors.log_out(here)
    await doors.log_out(here)
    await doors.log_out("no token")
    assert doors.person(here) is None
    assert isinstance(doors.person(there), Identity)
    for forged in ("", "x", "x" * 43, "ä" * 43, "\ud800" * 43, "' OR 1=1 --", "a" * 9999):
        assert doors.person(forged) is None
        assert doors.machine(forged) is None


def test_a_new_password_ends_every_login_of_its_account_alone(doors, anna):
    at(doors, T0).add("berta", Role.VIEWER, PASSWORD)
    hers, others = [log_in(doors) for _ in range(3)], log_in(doors, name="berta")
    at(doors, T0 + S).set_password(anna, "another rope gauge")

    assert {at(doors, T0 + S).person(token) for token in hers} == {None}
    assert isinstance(at(doors, T0 + S).person(others), Identity)
    assert refused(doors, anna, PASSWORD) == 401
    log_in(doors, T0 + S, password="another rope gauge")  # noqa: S106


def test_a_password_changed_while_the_old_one_is_checked_opens_nothing(access, doors, hasher, anna):
    class Meanwhile(Hashing):
        """Somebody changes the password right after it was found to be right."""

        def verify(self, stored: str | None, password: str) -> bool:
            is_right = super().verify(stored, password)
            access.accounts.set_password(anna, self.hash("another rope gauge"), T0)
            return is_right

    doors = Authenticator(access, doors.clock, hashing=Meanwhile(hasher))
    assert refused(doors, anna, PASSWORD) == 401


def test_removing_an_account_ends_its_logins_also_for_its_namesake(doors, access, anna):
    token = log_in(doors)
    doors.add("berta", Role.ADMIN, PASSWORD)
    for role in (Role.VIEWER, Role.ENGINEER):
        access.accounts.set_role(anna, role, T0)
        found = doors.person(token)
        assert isinstance(found, Identity)
        assert found.role is role  # from the next request on
    access.accounts.remove(anna, T0)
    doors.add(anna, Role.ADMIN, PASSWORD)
    assert doors.person(token) is None


@pytest.mark.usefixtures("anna")
def test_an_account_has_only_so_many_logins_and_the_oldest_goes(doors):
    tokens = [log_in(doors, T0 + number * S) for number in range(MAX_SESSIONS + 2)]
    now_ns = T0 + MAX_SESSIONS * S
    lives = [isinstance(at(doors, now_ns).person(token), Identity) for token in tokens]
    assert lives == [False, False] + [True] * MAX_SESSIONS
    assert len(set(tokens)) == len(tokens)
    assert {len(token) for token in tokens} == {43}  # 256 bits in base64


@pytest.mark.usefixtures("anna")
def test_old_logins_are_forgotten_when_somebody_logs_in(doors, path):
    doors.add("berta", Role.VIEWER, PASSWORD)
    log_in(doors)
    log_in(doors, T0 + 13 * H, "berta")
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("SELECT account FROM session").fetchall() == [("berta",)]


def test_a_login_renews_a_hash_once_the_parameters_have_risen(access, doors, dearer_hasher, anna):
    before = log_in(doors)
    later = Authenticator(access, doors.clock, hashing=Hashing(dearer_hasher))
    stored = []
    for number in range(2):
        log_in(later, T0 + number * S)
        account = access.accounts.get(anna)
        assert account is not None
        stored.append(account.password_hash)

    assert "t=2" in stored[0]
    assert stored[0] == stored[1]  # once
    assert isinstance(doors.person(before), Identity)  # the password is the same


def test_after_failures_even_the_right_password_waits_until_the_wait_is_over(doors, anna, hasher):
    for _ in range(ACCOUNT_FREE):
        assert refused(doors, anna, "wrong") == 401
    before = vars(hasher)["n_verified"]

    assert refused(at(doors, T0 + S // 2), anna, PASSWORD) == 429
    assert vars(hasher)["n_verified"] == before
    assert log_in(doors, T0 + S)


def test_passwords_tried_all_at_once_are_counted_one_by_one(doors, anna):
    with ThreadPoolExecutor(16) as threads:
        tried = list(threads.map(lambda n: refused(doors, anna, f"wrong {n}"), range(64)))
    assert tried.count(401) == ACCOUNT_FREE


@pytest.mark.usefixtures("anna")
def test_who_may_come_in_does_so_also_while_nothing_can_be_noted(doors, access, monkeypatch):
    def refuse(*_: object) -> None:
        raise StoreError("disk full")

    key, shown = at(doors, T0).create_key("historian", Role.VIEWER, (), 30)
    token, step = log_in(doors), 20 * 60 * S
    with monkeypatch.context() as full:
        for store in (access.sessions, access.keys):
            full.setattr(store, "see", refuse)
        full.setattr(access.sessions, "end", refuse)
        assert isinstance(at(doors, T0 + step).person(token), Identity)
        assert isinstance(at(doors, T0 + step).machine(shown), Identity)
        assert at(doors, T0 + 2 * step).person(token) is None
    assert isinstance(at(doors, T0 + step).person(token), Identity)
    assert isinstance(at(doors, T0 + 2 * step).person(token), Identity)
    assert access.keys.get(key.id).used_ns is None  # type: ignore[union-attr]


def test_a_key_for_one_unit_opens_no_other_and_changes_nothing_of_the_plant():
    key = Identity("historian", Role.ENGINEER, Means.KEY, ("U1",))

    assert key.may(Permission.CHANGE_MEASURING, "U1")
    assert not key.may(Permission.READ, "U2")
    assert key.may(Permission.READ)
    assert not key.may(Permission.CHANGE_MEASURING)
    assert not key.may(Permission.CHANGE_ACCESS, "U1")
    # actions of a key are not taken for those of an account of its name
    assert {Identity("anna", Role.VIEWER, means).actor for means in Means} == {"anna", "key:anna"}


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "::1", "localhost"])
def test_loopback_needs_no_login(plant, access, host):
    # a Unix socket is left to the proxy that opens it
    for settings in (
        ServiceSettings(host=host),
        ServiceSettings(host="0.0.0.0", socket="/run/x"),  # noqa: S104
    ):
        require_protected(plant.model_copy(update={"service": settings}), access)


@pytest.mark.parametrize(
    "host",
    ["0.0.0.0", "::", "10.0.0.5", "plant.example", "127.0.0.1.example", "::ffff:10.0.0.5"],  # noqa: S104
)
def test_other_addresses_need_tls_and_an_account(plant, access, host):
    with pytest.raises(ValidationError, match=r"\[service\.tls\]"):
        ServiceSettings(host=host)
    settings = ServiceSettings(host=host, tls=TlsSettings(certificate="x.crt", key="x.key"))
    reachable = plant.model_copy(update={"service": settings})
    with pytest.raises(ClosedError, match=f'"{host}".*users add'):
        require_protected(reachable, access)
    access.accounts.add("anna", Role.VIEWER, "hash", T0)
    require_protected(reachable, access)
