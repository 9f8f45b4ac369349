"""Notification of the service manager by systemd's protocol, sd_notify(3)."""

import os
import socket
from collections.abc import Mapping

import structlog

log = structlog.get_logger()

US_PER_S = 1e6


class ServiceManager:
    """Sends notifications to the service manager, if it asked for them.

    Parameters
    ----------
    environment
        Source of ``NOTIFY_SOCKET``, ``WATCHDOG_USEC`` and ``WATCHDOG_PID``.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._address = _address(environment.get("NOTIFY_SOCKET", ""))
        self.watchdog_s = _watchdog_s(environment) if self._address else None
        self._is_reached = True

    @property
    def listens(self) -> bool:
        """Whether a service manager receives notifications."""
        return self._address is not None

    def notify(self, **assignments: str) -> None:
        """Send one datagram without waiting; log the first that is not accepted.

        Parameters
        ----------
        assignments
            As in sd_notify(3): ``READY``, ``STATUS``, ``WATCHDOG``, ``STOPPING``.
        """
        if self._address is None:
            return
        message = "\n".join(f"{key}={_one_line(value)}" for key, value in assignments.items())
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
                sender.setblocking(False)
                sender.sendto(message.encode(), self._address)
        except OSError as error:
            if self._is_reached:
                log.warning("the service manager is not reached", reason=str(error))
            self._is_reached = False
        else:
            self._is_reached = True


def _address(named: str) -> str | None:
    """Return the socket's address: a path, or an abstract name that begins with @."""
    if named.startswith("@"):
        return "\0" + named[1:]
    if named.startswith("/"):
        return named
    if named:
        log.warning("NOTIFY_SOCKET is neither a path nor an abstract name", value=named)
    return None


def _watchdog_s(environment: Mapping[str, str]) -> float | None:
    """Return the watchdog's interval, None if it does not watch this process."""
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return None
    given = environment.get("WATCHDOG_USEC", "")
    return int(given) / US_PER_S if given.isdecimal() and int(given) > 0 else None


def _one_line(value: str) -> str:
    """Join lines: a line break would begin another assignment."""
    return " ".join(value.split())


NO_MANAGER = ServiceManager({})
