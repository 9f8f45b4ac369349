"""How long logins wait after failures."""

import pytest

from service.api.auth.backoff import (
    ACCOUNT_FREE,
    ACCOUNT_LONGEST_S,
    FORGET_S,
    PEER_FREE,
    PEER_LONGEST_S,
    Backoff,
    FailureCounts,
    client_of,
)

S = 1_000_000_000
HERE, THERE = "10.0.0.1", "10.0.0.2"


def fail_until_waiting(backoff: Backoff, name: str, peer: str, now_ns: int = 0) -> int:
    """Try wrong passwords until one has to wait; how many could be tried."""
    return next(n for n in range(1000) if backoff.attempt(name, peer, now_ns))


def test_each_failure_doubles_the_wait_of_an_account_up_to_its_limit():
    backoff, now_ns, waits = Backoff(), 0, []
    for number in range(200):
        wait_s = backoff.attempt("admin", f"192.0.2.{number}", now_ns)
        if wait_s:
            waits.append(wait_s)
            now_ns += round(wait_s * S)
            assert backoff.attempt("admin", f"198.51.100.{number}", now_ns) == 0.0
    assert waits[:8] == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 60.0, 60.0]
    assert max(waits) == ACCOUNT_LONGEST_S


def test_no_place_waits_longer_than_its_limit():
    backoff, now_ns, waits = Backoff(), 0, []
    for number in range(40):
        wait_s = backoff.attempt(f"user{number}", HERE, now_ns)
        waits.append(wait_s)
        now_ns += round(wait_s * S)
        backoff.attempt(f"user{number}", HERE, now_ns)
    assert max(waits) == PEER_LONGEST_S


def test_peers_without_an_address_do_not_wait_for_each_other():
    backoff = Backoff()
    for number in range(100):
        assert backoff.attempt(f"user{number}", "", 0) == 0.0


def test_asking_too_soon_makes_no_wait_longer_and_an_hour_forgets_all():
    backoff = Backoff()
    assert fail_until_waiting(backoff, "anna", HERE) == ACCOUNT_FREE
    waits = [backoff.attempt("anna", HERE, tenth * S // 10) for tenth in range(10)]
    assert waits == pytest.approx([1.0 - tenth / 10 for tenth in range(10)])
    assert backoff.attempt("anna", HERE, S) == 0.0
    later_ns = S + round(FORGET_S * S)
    assert fail_until_waiting(backoff, "anna", HERE, later_ns) == ACCOUNT_FREE


def test_one_who_tries_many_accounts_waits_though_none_of_them_does():
    backoff = Backoff()
    n_tried = next(n for n in range(1000) if backoff.attempt(f"user{n}", HERE, 0))
    assert n_tried == PEER_FREE
    assert backoff.attempt("user0", THERE, 0) == 0.0


def test_strangers_do_not_keep_an_admin_from_where_he_has_been():
    backoff = Backoff()
    backoff.attempt("admin", HERE, 0)
    backoff.succeeded("admin", HERE)
    for number in range(50):
        backoff.attempt("admin", f"192.0.2.{number}", 0)
    assert backoff.attempt("admin", "192.0.2.200", 0) > 0.0
    n_tried = fail_until_waiting(backoff, "admin", HERE)  # without end he may not either
    assert n_tried == PEER_FREE


def test_a_login_of_ones_own_does_not_pay_for_failures_at_others():
    backoff, n_tried = Backoff(), 0
    while backoff.attempt(f"victim{n_tried}", HERE, 0) == 0.0:
        n_tried += 1
        if backoff.attempt("mallory", HERE, 0) == 0.0:
            backoff.succeeded("mallory", HERE)
    assert n_tried <= PEER_FREE


def test_right_passwords_never_wait_however_many():
    backoff = Backoff()
    for _ in range(100):
        assert backoff.attempt("anna", HERE, 0) == 0.0
        backoff.succeeded("anna", HERE)


def test_a_million_names_take_no_more_memory_than_the_first_thousands():
    book = FailureCounts(1, 60.0)
    for number in range(10_000):
        book.add(number, number)
    assert [n for n in (0, 5_903, 5_904, 9_999) if book.wait(n, 9_999)] == [5_904, 9_999]


@pytest.mark.parametrize(
    ("peer", "place"),
    [
        ("10.0.0.1", "10.0.0.1"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::"),
        ("2001:db8:1:2:ffff::1", "2001:db8:1:2::"),
        ("::ffff:10.0.0.1", "10.0.0.1"),
        ("fe80::1%eth0", "fe80::"),
        ("unix", "unix"),
        ("", ""),
    ],
)
def test_one_host_with_many_addresses_is_one_place(peer, place):
    assert client_of(peer) == place
