"""Plain JSON values into frozen dataclasses: every key, no other, and of the right kind."""

import math
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, get_args, get_origin, get_type_hints


def decode(kind: Any, value: object, path: str) -> Any:
    """Make a value of a kind: dataclass, enum, tuple, number, text, or one of these or None.

    Parameters
    ----------
    path
        Where the value stands, for messages.

    Raises
    ------
    ValueError
        With path and value.
    """
    if get_origin(kind) is types.UnionType:
        inner = next(k for k in get_args(kind) if k is not type(None))
        return None if value is None else decode(inner, value, path)
    if get_origin(kind) is tuple:
        return _tuple(get_args(kind), value, path)
    if is_dataclass(kind):
        return _dataclass(kind, value, path)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return _called(kind, value, path)
    return _plain(kind, value, path)


def _dataclass(kind: Any, value: object, path: str) -> Any:
    names = [field.name for field in fields(kind)]
    if not isinstance(value, Mapping) or set(value) != set(names):
        raise ValueError(f"{path}: expected an object with the keys {', '.join(names)}")
    hints = get_type_hints(kind)
    found = {name: decode(hints[name], value[name], f"{path}.{name}") for name in names}
    try:
        return kind(**found)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _tuple(kinds: tuple[Any, ...], value: object, path: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise ValueError(f"{path}: {value!r:.50} is not a list")
    if kinds[-1] is not Ellipsis:
        if len(kinds) != len(value):
            raise ValueError(f"{path}: {len(value)} values, expected {len(kinds)}")
    else:
        kinds = (kinds[0],) * len(value)
    return tuple(
        decode(kind, item, f"{path}[{row}]")
        for row, (kind, item) in enumerate(zip(kinds, value, strict=True))
    )


def _called(kind: type[Enum], value: object, path: str) -> Enum:
    try:
        return kind(value)
    except ValueError as error:
        names = ", ".join(str(member.value) for member in kind)
        raise ValueError(f"{path}: {value!r:.50} is not one of {names}") from error


def _plain(kind: Any, value: object, path: str) -> Any:
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        if not math.isfinite(value):
            raise ValueError(f"{path}: {value!r:.50} is not finite")
        return float(value)
    if type(value) is not kind:
        raise ValueError(f"{path}: {value!r:.50} is not of kind {kind.__name__}")
    return value
