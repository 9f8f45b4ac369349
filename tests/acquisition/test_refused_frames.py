"""Who asks a source what it could not use need not know what kind of source it is."""

from collections.abc import AsyncIterator, Mapping
from contextlib import AbstractAsyncContextManager

from acquisition.joined_source import JoinedSource
from acquisition.source import refused_frames_of
from core.blocks import SampleBlock
from core.quality import Reading


class Ring:
    """A device whose protocol knows of no frames."""

    def connect(self) -> AbstractAsyncContextManager[AsyncIterator[SampleBlock]]:
        raise NotImplementedError


class Bus(Ring):
    """A device that is listened to."""

    refused_frames: Mapping[str, int] = {"duplicate": 2}


class NoSlowValues:
    def watch(self) -> AbstractAsyncContextManager[None]:
        raise NotImplementedError

    def current(self) -> Mapping[str, Reading]:
        return {}


def test_a_bus_says_what_it_refused_also_behind_slow_values_of_another_device() -> None:
    assert refused_frames_of(Bus()) == {"duplicate": 2}
    assert refused_frames_of(JoinedSource(Bus(), NoSlowValues())) == {"duplicate": 2}
    assert refused_frames_of(Ring()) == {}
    assert refused_frames_of(JoinedSource(Ring(), NoSlowValues())) == {}
