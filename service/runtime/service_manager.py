"""Notifications to the service manager by the protocol of systemd, sd_notify(3)."""

import os
import socket
from collections.abc import Mapping

import structlog

log = structlog.get_logger()

US_PER_S = 1e6


class ServiceManager:
    """Client of the service manager; without ``NOTIFY_SOCKET`` it sends nothing.

    `environment` may contain ``NOTIFY_SOCKET``, ``WATCHDOG_USEC`` and ``WATCHDOG_PID``; from them
    comes `watchdog_s`, the time-out of the watchdog, None without a watchdog.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._address = _address(environment.get("NOTIFY_SOCKET", ""))
        self.watchdog_s = _watchdog_s(environment) if self._address else None
        self._is_reached = True

    def notify(self, **assignments: str) -> None:
        """Send variables of sd_notify(3), such as ``READY``, without blocking; log failure once."""
        if self._address is None:
            return
        # a line break separates assignments
        message = "\n".join(f"{key}={' '.join(v.split())}" for key, v in assignments.items())
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
                sender.setblocking(False)
                sender.sendto(message.encode(), self._address)
        except OSError as error:
            if self._is_reached:
                log.warning("the service manager cannot be reached", reason=str(error))
            self._is_reached = False
        else:
            self._is_reached = True


def _address(named: str) -> str | None:
    """Return the address of a socket given by path or by abstract name (@…), or None."""
    if named.startswith("@"):
        return "\0" + named[1:]
    if named.startswith("/"):
        return named
    if named:
        log.warning("NOTIFY_SOCKET is not a path or @name; nothing is notified", value=named)
    return None


def _watchdog_s(environment: Mapping[str, str]) -> float | None:
    """Return the watchdog interval in seconds; None if no watchdog supervises this process."""
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return None
    given = environment.get("WATCHDOG_USEC", "")
    return int(given) / US_PER_S if given.isdecimal() and int(given) > 0 else None


NO_MANAGER = ServiceManager({})
