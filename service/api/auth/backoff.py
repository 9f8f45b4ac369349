"""Failed logins make the next one wait, by account and by where it comes from."""

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address
from threading import Lock

NS_PER_S = 1_000_000_000
MAX_REMEMBERED = 4096
IPV6_NETWORK_BITS = 64
"""One household or one attacker has at least that many addresses to choose from."""


@dataclass(frozen=True)
class WaitRule:
    """How waits grow.

    Parameters
    ----------
    n_free
        Failures without a wait; each further one doubles it, from a second on.
    longest_s
        No wait is longer.
    forget_s
        After so long without a failure all is forgotten.
    """

    n_free: int
    longest_s: float
    forget_s: float = 3600.0

    def wait_ns(self, n_failures: int) -> int:
        """How long after the newest of so many failures nothing is tried."""
        if n_failures < self.n_free:
            return 0
        doubled_s = 2.0 ** min(n_failures - self.n_free, 30)
        return round(min(doubled_s, self.longest_s) * NS_PER_S)


OF_ACCOUNT = WaitRule(n_free=5, longest_s=60.0)
"""Short: somebody else's failures must not keep a person from the plant for long."""

OF_PEER = WaitRule(n_free=10, longest_s=900.0)
"""More failures are free: a control room may come from one address."""


@dataclass(frozen=True)
class Failures:
    """Failures in a row, and when the newest was."""

    number: int
    newest_ns: int


class Backoff:
    """Failed logins of late, in bounded memory; may be used from several threads.

    An account is not kept from peers that it has logged in from since the service started: who
    tries passwords from elsewhere delays only strangers.

    Times are of a clock that never goes back.
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
        """Ask to try a login: 0 if it may be tried, else how long it must still wait, seconds.

        What may be tried counts as a failure until it has succeeded, so that many at once are
        many; names that no account has count, too, which therefore tells nothing. What may not be
        tried does not count: asking too soon makes no wait longer.
        """
        place = place_of(peer)
        with self._lock:
            is_known = (name, place) in self._known
            account_ns = 0 if is_known else self._accounts.wait(name, now_ns)
            if wait_ns := max(account_ns, self._peers.wait(place, now_ns)):
                return wait_ns / NS_PER_S
            if place:  # all behind a proxy that does not say for whom it asks are one
                self._peers.add(place, now_ns)
            if not is_known:
                self._accounts.add(name, now_ns)
        return 0.0

    def knows(self, name: str, peer: str) -> bool:
        """Whether an account has logged in from a peer since the service started."""
        with self._lock:
            return (name, place_of(peer)) in self._known

    def succeeded(self, name: str, peer: str) -> None:
        """Remember where an account is at home; earlier failures of its peer stay.

        Otherwise who has one account could try others without end, with a login of his own between.
        """
        place = place_of(peer)
        with self._lock:
            self._accounts.forget(name)
            self._peers.take_back(place)
            self._known[name, place] = None
            self._known.move_to_end((name, place))
            if len(self._known) > self._max_remembered:
                self._known.popitem(last=False)


class FailureBook:
    """Failures by whom they are counted for; the longest untouched is forgotten first."""

    def __init__(self, rule: WaitRule, max_remembered: int) -> None:
        self._rule, self._max_remembered = rule, max_remembered
        self._failures: OrderedDict[Hashable, Failures] = OrderedDict()

    def __len__(self) -> int:
        return len(self._failures)

    def wait(self, whom: Hashable, now_ns: int) -> int:
        """Nanoseconds until something may be tried."""
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

    def take_back(self, whom: Hashable) -> None:
        """Count one failure less."""
        found = self._failures.pop(whom, None)
        if found is not None and found.number > 1:
            self._failures[whom] = Failures(found.number - 1, found.newest_ns)

    def forget(self, whom: Hashable) -> None:
        """Begin again."""
        self._failures.pop(whom, None)

    def _of_late(self, whom: Hashable, now_ns: int) -> Failures | None:
        found = self._failures.get(whom)
        if found is None or now_ns - found.newest_ns >= self._rule.forget_s * NS_PER_S:
            return None
        return found


def place_of(peer: str) -> str:
    """What of a peer's address counts: all of IPv4, the network of IPv6, anything else as it is."""
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
