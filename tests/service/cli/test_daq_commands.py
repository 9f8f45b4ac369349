"""What a running simulated DAQ answers to a line of its user."""

import asyncio
import json
import os

import pytest

from acquisition.errors import LinkError
from service.app.simulated_daq import execute_command, run_daq
from service.cli.daq import held_lines


class Device:
    """A server that notes what it was told to do wrong."""

    def __init__(self) -> None:
        self.endpoint = {"port": 1}
        self.faults: list[tuple[str, int]] = []

    def inject(self, fault: str, count: int = 1) -> None:
        if fault not in ("drop", "tear"):
            raise LookupError(f"unknown fault {fault}; there are drop, tear")
        self.faults.append((fault, count))

    async def run(self) -> None:
        await asyncio.Event().wait()

    async def __aenter__(self) -> "Device":
        return self

    async def __aexit__(self, *_: object) -> None: ...


class Failing(Device):
    """A server whose network goes away."""

    async def run(self) -> None:
        raise LinkError("the network is unreachable")


@pytest.fixture
def devices() -> dict[str, Device]:
    return {"U1": Device(), "U2": Device()}


def test_a_fault_is_injected_where_and_as_often_as_told(devices) -> None:
    assert execute_command(devices, "U2 drop 3\n") == {"done": "U2 drop 3"}
    assert execute_command(devices, "U2 tear") == {"done": "U2 tear"}
    assert devices["U2"].faults == [("drop", 3), ("tear", 1)]
    assert devices["U1"].faults == []


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", "command must be UNIT FAULT [COUNT], got ''"),
        ("U1", "command must be UNIT FAULT [COUNT], got 'U1'"),
        ("U1 drop three", "command must be UNIT FAULT [COUNT], got 'U1 drop three'"),
        ("U1 drop -1", "command must be UNIT FAULT [COUNT], got 'U1 drop -1'"),
        ("U1 drop 1000001", "COUNT must be at most 1000000, got 1000001"),
        ("U1 drop 1 2", "command must be UNIT FAULT [COUNT], got 'U1 drop 1 2'"),
        ("U3 drop", "unknown unit U3; known units: U1, U2"),
        ("U1 melt", "unknown fault melt; there are drop, tear"),
    ],
)
def test_a_line_that_is_no_command_changes_nothing_and_says_why(devices, line, words) -> None:
    assert execute_command(devices, line) == {"refused": words}
    assert devices["U1"].faults == []


async def test_a_server_that_cannot_go_on_says_why_in_one_error(devices) -> None:
    told: list[str] = []
    with pytest.raises(LinkError, match="unreachable"):
        await run_daq(devices | {"U3": Failing()}, told.append, controlled=False)
    assert json.loads(told[0]) == {name: {"port": 1} for name in ("U1", "U2", "U3")}


def test_nobody_else_gets_the_name_of_a_line_whose_daq_has_ended() -> None:
    ours, theirs = os.openpty()
    name, others = os.ttyname(theirs), []
    with held_lines({"U1": {"device": name, "parity": "none"}, "U2": {"port": 502}}):
        os.close(ours)
        os.close(theirs)
        others += [os.openpty() for _ in range(3)]
        assert name not in {os.ttyname(line) for _, line in others}
        assert not os.path.exists(name)
    for ends in others:
        for end in ends:
            os.close(end)
