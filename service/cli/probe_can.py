"""`padwatch probe can`: what passes on a CAN bus, and what a DBC makes of it."""

import json
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from acquisition.can.bus import foreign_errors_renamed, open_bus
from acquisition.can.dbc import load_dbc
from acquisition.can.settings import CanLinkSettings
from acquisition.can.slcan import SlcanBus
from acquisition.can.survey import BusLook, MessageLook, Survey
from acquisition.errors import AcquisitionError, FrameError
from service.cli.plant_file import fail

RECEIVE_S = 0.1
LARGE = 1e6


def can(
    interface: Annotated[str, typer.Option(help='python-can\'s name: "socketcan", "slcan", …')],
    channel: Annotated[
        str, typer.Option(help='As the interface calls it: "can0", "/dev/ttyACM0".')
    ],
    dbc: Annotated[Path | None, typer.Option(help="DBC file to decode by.")] = None,
    seconds: Annotated[float, typer.Option(min=0.1, max=3600.0, help="How long to listen.")] = 3.0,
    bitrate: Annotated[int | None, typer.Option(help="Bits per second of the bus.")] = None,
    fd: Annotated[bool, typer.Option("--fd", help="The bus carries CAN FD.")] = False,
    data_bitrate: Annotated[int | None, typer.Option(help="Of the data phase of CAN FD.")] = None,
    option: Annotated[
        list[str] | None, typer.Option(help="KEY=VALUE for python-can; may be repeated.")
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON, not tables.")] = False,
) -> None:
    """Listen to a CAN bus and print every message seen; nothing is sent.

    With a DBC its signals are decoded. Without, every two bytes are shown as a signed number in
    both byte orders; the one that changes less from frame to frame is marked.
    """
    link = CanLinkSettings(
        interface=interface,
        channel=channel,
        bitrate=bitrate,
        fd=fd,
        data_bitrate=data_bitrate,
        options=dict(_option(text) for text in option or []),
    )
    try:
        survey = Survey(load_dbc(dbc) if dbc else {})
        look = _listened(link, survey, seconds)
    except AcquisitionError as error:
        fail(f"padwatch probe: {error}")
    lines = _lines(look, dbc is not None)
    typer.echo(json.dumps(asdict(look), indent=1) if json_output else "\n".join(lines))


def _option(text: str) -> tuple[str, str | int | float | bool]:
    key, equals, value = text.partition("=")
    if not equals:
        fail(f"padwatch probe: option {text!r} must be KEY=VALUE", code=2)
    try:
        return key, json.loads(value)
    except ValueError:
        return key, value


def _listened(link: CanLinkSettings, survey: Survey, seconds: float) -> BusLook:
    bus = open_bus(link, None)
    start_s = time.monotonic()
    try:
        while time.monotonic() - start_s < seconds:
            try:
                with foreign_errors_renamed(str(link)):
                    message = bus.recv(RECEIVE_S)
            except FrameError:
                survey.add_malformed(1)
                continue
            if message is not None:
                survey.add(message)
        if isinstance(bus, SlcanBus):
            survey.add_malformed(bus.take_n_malformed())
        return survey.look(time.monotonic() - start_s)
    finally:
        with foreign_errors_renamed(str(link)):
            bus.shutdown()


def _lines(look: BusLook, has_dbc: bool) -> Iterator[str]:
    n_frames = sum(message.n_frames for message in look.messages)
    yield (
        f"{n_frames} frames of {len(look.messages)} ids in {look.duration_s:.1f} s;"
        f" {look.n_remote} remote frames, {look.n_error} error frames"
    )
    if look.n_malformed:
        rate = look.n_malformed / look.duration_s
        yield (
            f"{look.n_malformed} malformed frames, {rate:.1f}/s: what came is no CAN frame;"
            " check bit rate, and that an slcan adapter appends no time stamps"
        )
    for message in look.messages:
        yield from _message_lines(message, has_dbc)
    if look.not_seen:
        yield f"\nin the DBC but not seen: {', '.join(look.not_seen)}"


def _message_lines(message: MessageLook, has_dbc: bool) -> Iterator[str]:
    kind = ("extended" if message.extended else "standard") + (" FD" if message.fd else "")
    lengths = "/".join(str(length) for length in message.lengths)
    name = message.name or ("not in the DBC" if has_dbc else "")
    yield (
        f"\n{message.frame_id:#x} {kind}  {message.frames_per_s:.1f}/s  {lengths} bytes"
        f"  {message.first_bytes}  {name}"
    )
    if message.misfit:
        yield f"  does not fit: {message.misfit}"
    for signal in message.signals:
        low, high = _number(signal.minimum), _number(signal.maximum)
        yield f"  {signal.name:<24} {low:>12} … {high:<12} {signal.unit}"
    for word in message.words:
        little, big = (
            f"{_number(span.minimum):>6} … {_number(span.maximum):<6}"
            f"{'*' if word.smoother == order else ' '}"
            for order, span in (("little", word.little), ("big", word.big))
        )
        yield f"  bytes {word.offset}, {word.offset + 1}:  little-endian {little}  big-endian {big}"


def _number(value: float | None) -> str:
    if value is None:
        return "none"
    return f"{value:.6g}" if abs(value) < LARGE else f"{value:.0f}"
