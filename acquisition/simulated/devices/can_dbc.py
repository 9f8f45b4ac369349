"""The simulated CAN DAQ's DBC, and the settings with which padwatch reads it."""

from pathlib import Path
from typing import Any

from acquisition.can.settings import CanChannel, CanLinkSettings, CanSettings, CanSlowChannel
from acquisition.simulated.devices.can_shape import CanShape, Field, Kind, MessageShape, dbc_name

_NODE = "DAQ"
_NAME = "the simulated CAN DAQ's own DBC"
_CLASSIC_FORMAT, _FD_FORMAT = 0, 14
_HEADER = f"""VERSION ""

NS_ :

BS_:

BU_: {_NODE}
"""
_ATTRIBUTES = """
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","reserved","reserved",\
"reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved",\
"reserved","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
"""


def daq_dbc(shape: CanShape) -> str:
    """Text of the DBC file that describes the simulated DAQ's messages."""
    parts = [_HEADER]
    parts += [_message(message) for message in shape.messages]
    parts.append(_ATTRIBUTES)
    for message in shape.messages:
        number = (_FD_FORMAT if message.fd else _CLASSIC_FORMAT) + message.extended
        parts.append(f'BA_ "VFrameFormat" BO_ {_dbc_id(message)} {number};\n')
    for message in shape.messages:
        for field in message.fields:
            if field.kind is Kind.F32:
                parts.append(f"SIG_VALTYPE_ {_dbc_id(message)} {field.name} : 1;\n")
    return "".join(parts)


def daq_settings(
    shape: CanShape, link: CanLinkSettings, units: tuple[str, ...], **others: Any
) -> CanSettings:
    """Settings of a source that reads the simulated DAQ; its DBC need not lie in a file.

    Parameters
    ----------
    units
        Engineering unit of each waveform channel.
    others
        Further settings of the source.
    """
    where = {field.name: m.name for m in shape.messages for field in m.fields}
    return CanSettings(
        link=link,
        dbc=Path(_NAME),
        dbc_text=daq_dbc(shape),
        channels=tuple(
            CanChannel(c.id, unit, tuple(f"{where[n]}.{n}" for n in shape.sample_names(c.id)))
            for c, unit in zip(shape.channels, units, strict=True)
        ),
        slow=tuple(
            CanSlowChannel(s.id, s.unit, f"{where[dbc_name(s.id)]}.{dbc_name(s.id)}")
            for s in shape.slow
        ),
        **_beside(shape),
        **others,
    )


def _beside(shape: CanShape) -> dict[str, Any]:
    """Counters and all that is not a channel."""
    where = {field.name: m.name for m in shape.messages for field in m.fields}
    counters = [
        f"{message.name}.{field.name}"
        for message in shape.messages
        for field in message.fields
        if field.name in ("counter", "index")
    ]
    return {
        "counters": tuple(counters),
        "frame_samples": tuple(f"{m.name}.valid" for m in shape.waves) if shape.fd else (),
        "epoch": "HEAD.epoch",
        "ok_bits": f"{where['ok']}.ok",
        "seconds": f"{where['seconds']}.seconds",
        "microseconds": f"{where['microseconds']}.microseconds",
        "hold_samples": f"{where['n_samples']}.n_samples",
    }


def _message(message: MessageShape) -> str:
    lines = [f"\nBO_ {_dbc_id(message)} {message.name}: {message.length} {_NODE}\n"]
    lines += [_signal(field, message.fd) for field in message.fields]
    return "".join(lines)


def _signal(field: Field, motorola: bool) -> str:
    start = 8 * field.offset + (7 if motorola else 0)
    sign = "-" if field.kind in (Kind.I16, Kind.F32) else "+"
    place = f"{start}|{8 * field.kind.n_bytes}@{0 if motorola else 1}{sign}"
    return f' SG_ {field.name} : {place} ({field.factor!r},0) [0|0] "{field.unit}" {_NODE}\n'


def _dbc_id(message: MessageShape) -> int:
    return message.frame_id | (1 << 31 if message.extended else 0)
