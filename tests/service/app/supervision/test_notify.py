"""What reaches a service manager's socket."""

import os
import socket
from pathlib import Path
from typing import Any

import pytest
import structlog

from service.runtime.service_manager import ServiceManager


@pytest.mark.parametrize("manager_socket", ["", "\0"], ids=["path", "abstract"], indirect=True)
def test_a_manager_hears_what_it_is_told_without_line_breaks(manager_socket: Any) -> None:
    manager = ServiceManager(manager_socket.environment)

    manager.notify(READY="1", STATUS="all well\nWATCHDOG=trigger")

    assert manager.listens
    assert manager.watchdog_s == 10.0
    assert manager_socket.received == [{"READY": "1", "STATUS": "all well WATCHDOG=trigger"}]


def test_without_a_socket_nobody_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("a socket was opened")

    monkeypatch.setattr(socket, "socket", refuse)
    manager = ServiceManager({"WATCHDOG_USEC": "10000000"})
    manager.notify(READY="1")

    assert not manager.listens
    assert manager.watchdog_s is None


@pytest.mark.parametrize(
    "given",
    [
        {"WATCHDOG_USEC": "soon"},
        {"WATCHDOG_USEC": "0"},
        {"WATCHDOG_USEC": "-5"},
        {"WATCHDOG_USEC": "10000000", "WATCHDOG_PID": str(os.getpid() + 1)},
    ],
)
def test_a_watchdog_that_is_not_for_this_process_is_not_fed(given: dict[str, str]) -> None:
    assert ServiceManager({"NOTIFY_SOCKET": "@x", **given}).watchdog_s is None


@pytest.mark.parametrize("address", ["relative/path", "vsock:2:1234"])
def test_an_address_of_another_kind_is_not_used(address: str) -> None:
    with structlog.testing.capture_logs() as said:
        manager = ServiceManager({"NOTIFY_SOCKET": address})
        manager.notify(READY="1")

    assert not manager.listens
    assert [entry["value"] for entry in said] == [address]


def test_a_manager_that_is_gone_is_logged_once_and_stops_nothing(tmp_path: Path) -> None:
    manager = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "gone")})

    with structlog.testing.capture_logs() as said:
        manager.notify(WATCHDOG="1")
        manager.notify(WATCHDOG="1")

    assert [entry["event"] for entry in said] == ["the service manager is not reached"]


def test_a_manager_that_does_not_read_never_makes_the_service_wait(manager_socket: Any) -> None:
    manager = ServiceManager(manager_socket.environment)

    with structlog.testing.capture_logs() as said:
        for _ in range(100_000):
            manager.notify(WATCHDOG="1")
            if said:
                break

    assert [entry["event"] for entry in said] == ["the service manager is not reached"]
    assert manager_socket.received
