"""Rate limits: exponential backoff after failed logins, and token buckets."""

from collections import OrderedDict
from collections.abc import Hashable
from ipaddress import IPv4Address, IPv6Network, ip_address
from threading import Lock

from core.units import NS_PER_S

MAX_REMEMBERED = 4096
"""Maximum number of accounts, and of addresses, whose failures are stored."""

IPV6_NETWORK_BITS = 64
"""Length of the IPv6 address prefix that counts as one client, bits."""


FORGET_S = 3600.0
"""Time without a failure after which the number of failures is reset, s."""

ACCOUNT_FREE, ACCOUNT_LONGEST_S = 5, 60.0
"""Free failures and maximum wait of an account, short so that attackers do not lock out the owner.
"""

PEER_FREE, PEER_LONGEST_S = 10, 900.0
"""Free failures and maximum wait of an address; a control room may share one address."""


class Backoff:
    """Thread-safe backoff of logins by account and by client address; times are monotonic, ns.

    If an account has logged in from an address since the service started, failures at other
    addresses do not delay its next login from this address.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._accounts = FailureCounts(ACCOUNT_FREE, ACCOUNT_LONGEST_S)
        self._peers = FailureCounts(PEER_FREE, PEER_LONGEST_S)
        self._known: OrderedDict[tuple[str, str], None] = OrderedDict()

    def attempt(self, name: str, peer: str, now_ns: int) -> float:
        """Return the time until a login may be attempted, s; if it is 0, count the attempt.

        An attempt counts as a failure until it succeeds, so that concurrent attempts all count.
        `name` is the login name, `peer` the address of the client. Unknown names count too, so that
        waits do not reveal which accounts exist.
        """
        place = client_of(peer)
        with self._lock:
            is_known = (name, place) in self._known
            account_ns = 0 if is_known else self._accounts.wait(name, now_ns)
            if wait_ns := max(account_ns, self._peers.wait(place, now_ns)):
                return wait_ns / NS_PER_S
            if place:  # empty for all clients of a proxy that forwards no address
                self._peers.add(place, now_ns)
            if not is_known:
                self._accounts.add(name, now_ns)
        return 0.0

    def knows(self, name: str, peer: str) -> bool:
        """Whether the account `name` has logged in from the address `peer` since the start."""
        with self._lock:
            return (name, client_of(peer)) in self._known

    def succeeded(self, name: str, peer: str) -> None:
        """Reset the failures of an account after a login, and remember its address.

        Earlier failures of the address still count. Otherwise the owner of one account could try
        passwords of other accounts without limit by logging in between.
        """
        place = client_of(peer)
        with self._lock:
            self._accounts.forget(name)
            self._peers.subtract(place)
            self._known[name, place] = None
            self._known.move_to_end((name, place))
            if len(self._known) > MAX_REMEMBERED:
                self._known.popitem(last=False)


class FailureCounts:
    """Numbers of failed logins by account or address, and the waits after them.

    There is a wait from `n_free` consecutive failures: 1 s at first, doubled by each failure up to
    `longest_s`. Of more than `MAX_REMEMBERED`, the least recently changed number is dropped.
    """

    def __init__(self, n_free: int, longest_s: float) -> None:
        self.n_free, self._longest_s = n_free, longest_s
        self._failures: OrderedDict[Hashable, tuple[int, int]] = OrderedDict()

    def wait(self, key: Hashable, now_ns: int) -> int:
        """Return the time until an account or address may attempt a login, ns; 0 if it may now."""
        n_failures, newest_ns = self._recent(key, now_ns)
        if n_failures < self.n_free:
            return 0
        doubled_s = 2.0 ** min(n_failures - self.n_free, 30)
        wait_ns = round(min(doubled_s, self._longest_s) * NS_PER_S)
        return max(0, newest_ns + wait_ns - now_ns)

    def add(self, key: Hashable, now_ns: int) -> None:
        """Add one failure of an account or address at the monotonic time `now_ns`, ns."""
        number, _ = self._recent(key, now_ns)
        self._failures[key] = number + 1, now_ns
        self._failures.move_to_end(key)
        if len(self._failures) > MAX_REMEMBERED:
            self._failures.popitem(last=False)

    def subtract(self, key: Hashable) -> None:
        """Subtract one failure of an account or address, if it has any."""
        number, newest_ns = self._failures.pop(key, (0, 0))
        if number > 1:
            self._failures[key] = number - 1, newest_ns

    def forget(self, key: Hashable) -> None:
        """Delete all failures of an account or address, if it has any."""
        self._failures.pop(key, None)

    def _recent(self, key: Hashable, now_ns: int) -> tuple[int, int]:
        """Return the number of consecutive failures, and the time of the newest one, ns."""
        number, newest_ns = self._failures.get(key, (0, now_ns))
        is_old = now_ns - newest_ns >= FORGET_S * NS_PER_S
        return (0, now_ns) if is_old else (number, newest_ns)


def client_of(peer: str) -> str:
    """Return the client of an address: IPv4 address, IPv6 /64 network, or the text if invalid."""
    try:
        address = ip_address(peer.partition("%")[0])
    except ValueError:
        return peer
    if isinstance(address, IPv4Address):
        return str(address)
    network = IPv6Network((address, IPV6_NETWORK_BITS), strict=False)
    return str(address.ipv4_mapped or network.network_address)


class TokenBucket:
    """Token bucket for a rate limit.

    Parameters
    ----------
    n_at_once
        Capacity of the bucket, tokens; the bucket is full at the start.
    seconds_each
        Time after which a token is added, s.
    now_s
        Monotonic time of the start, s.
    """

    def __init__(self, n_at_once: int, seconds_each: float, now_s: float) -> None:
        self._n_at_once, self._seconds_each = float(n_at_once), seconds_each
        self._n_free, self._seen_s = self._n_at_once, now_s

    def take(self, now_s: float) -> bool:
        """Take a token if one is available at the monotonic time `now_s`; return whether it was."""
        self._n_free += (now_s - self._seen_s) / self._seconds_each
        self._n_free, self._seen_s = min(self._n_free, self._n_at_once), now_s
        if self._n_free < 1.0:
            return False
        self._n_free -= 1.0
        return True
