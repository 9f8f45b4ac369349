"""Waits after failed logins, by account and by address of the client."""

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address
from threading import Lock

NS_PER_S = 1_000_000_000
MAX_REMEMBERED = 4096
IPV6_NETWORK_BITS = 64
"""Prefix of an IPv6 address that counts as one client."""


@dataclass(frozen=True)
class WaitRule:
    """Growth of waits.

    Parameters
    ----------
    n_free
        Failures without a wait; the next waits 1 s, each further one twice as long.
    longest_s
        Maximum wait.
    forget_s
        Time without a failure after which all are forgotten.
    """

    n_free: int
    longest_s: float
    forget_s: float = 3600.0

    def wait_ns(self, n_failures: int) -> int:
        """Return the wait after a number of failures."""
        if n_failures < self.n_free:
            return 0
        doubled_s = 2.0 ** min(n_failures - self.n_free, 30)
        return round(min(doubled_s, self.longest_s) * NS_PER_S)


OF_ACCOUNT = WaitRule(n_free=5, longest_s=60.0)
"""Waits of an account; short, so that failures of others do not lock a person out."""

OF_PEER = WaitRule(n_free=10, longest_s=900.0)
"""Waits of an address; more failures are free, since a control room may share one."""


@dataclass(frozen=True)
class Failures:
    """Number of consecutive failures and time of the newest."""

    number: int
    newest_ns: int


class Backoff:
    """Recent failed logins, in bounded memory, safe for several threads.

    Failures from elsewhere do not delay an account at addresses from which it has logged in since
    the service started.

    Times are monotonic.
    """

    def __init__(
        self,
        of_account: WaitRule = OF_ACCOUNT,
        of_peer: WaitRule = OF_PEER,
        max_remembered: int = MAX_REMEMBERED,
    ) -> None:
        self._lock = Lock()
        self._accounts = FailureBook(of_account, max_remembered)
        self._peers = FailureBook(of_peer, max_remembered)
        self._known: OrderedDict[tuple[str, str], None] = OrderedDict()
        self._max_remembered = max_remembered

    def attempt(self, name: str, peer: str, now_ns: int) -> float:
        """Return the wait before a login may be tried, s; 0 if it may be tried now.

        An attempt counts as a failure until it succeeds, so that concurrent attempts all count.
        Unknown names count too, so that waits reveal nothing. An attempt that must wait does not
        count.
        """
        place = place_of(peer)
        with self._lock:
            is_known = (name, place) in self._known
            account_ns = 0 if is_known else self._accounts.wait(name, now_ns)
            if wait_ns := max(account_ns, self._peers.wait(place, now_ns)):
                return wait_ns / NS_PER_S
            if place:  # clients of a proxy that forwards no address share one
                self._peers.add(place, now_ns)
            if not is_known:
                self._accounts.add(name, now_ns)
        return 0.0

    def knows(self, name: str, peer: str) -> bool:
        """Whether an account has logged in from a peer since the service started."""
        with self._lock:
            return (name, place_of(peer)) in self._known

    def succeeded(self, name: str, peer: str) -> None:
        """Remember the address of a login; earlier failures of that address remain.

        Otherwise the owner of one account could try others without limit by logging in between.
        """
        place = place_of(peer)
        with self._lock:
            self._accounts.forget(name)
            self._peers.revoke_again(place)
            self._known[name, place] = None
            self._known.move_to_end((name, place))
            if len(self._known) > self._max_remembered:
                self._known.popitem(last=False)


class FailureBook:
    """Failures by account or address; the least recently used is forgotten first."""

    def __init__(self, rule: WaitRule, max_remembered: int) -> None:
        self._rule, self._max_remembered = rule, max_remembered
        self._failures: OrderedDict[Hashable, Failures] = OrderedDict()

    def __len__(self) -> int:
        return len(self._failures)

    def wait(self, whom: Hashable, now_ns: int) -> int:
        """Return the time until the next attempt, ns."""
        found = self._of_late(whom, now_ns)
        if found is None:
            return 0
        return max(0, found.newest_ns + self._rule.wait_ns(found.number) - now_ns)

    def add(self, whom: Hashable, now_ns: int) -> None:
        """Count a failure."""
        before = self._of_late(whom, now_ns)
        self._failures[whom] = Failures((before.number if before else 0) + 1, now_ns)
        self._failures.move_to_end(whom)
        if len(self._failures) > self._max_remembered:
            self._failures.popitem(last=False)

    def revoke_again(self, whom: Hashable) -> None:
        """Count one failure less."""
        found = self._failures.pop(whom, None)
        if found is not None and found.number > 1:
            self._failures[whom] = Failures(found.number - 1, found.newest_ns)

    def forget(self, whom: Hashable) -> None:
        """Forget the failures."""
        self._failures.pop(whom, None)

    def _of_late(self, whom: Hashable, now_ns: int) -> Failures | None:
        found = self._failures.get(whom)
        if found is None or now_ns - found.newest_ns >= self._rule.forget_s * NS_PER_S:
            return None
        return found


def place_of(peer: str) -> str:
    """Return the client of an address: an IPv4 address, an IPv6 network, or the text itself."""
    try:
        address = ip_address(peer.partition("%")[0])
    except ValueError:
        return peer
    if isinstance(address, IPv6Address):
        if address.ipv4_mapped is not None:
            return str(address.ipv4_mapped)
        n_host_bits = 128 - IPV6_NETWORK_BITS
        return str(IPv6Address(int(address) >> n_host_bits << n_host_bits))
    return str(address)
