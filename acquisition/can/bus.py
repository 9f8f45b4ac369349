"""Opening of python-can buses; the only module that names python-can interfaces."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import can
from serial import SerialException

from acquisition.can.settings import CanLinkSettings
from acquisition.can.slcan import SlcanBus
from acquisition.errors import AcquisitionError, ConfigError, FrameError, LinkError

_ID_MASK = 0x1FFFFFFF
_NO_SUCH_FAMILY = 97
_SLCAN_CLOCK_HZ = 80_000_000
_SAMPLE_POINT_PERCENT = 80.0
_FILTERED_BY_KERNEL = ("socketcan",)
"""Interfaces that filter ids in the kernel and still deliver error frames."""

LINUX_ERROR_FRAMES = ("socketcan", "slcan", "gs_usb", "virtual")
"""Interfaces whose error frames have the SocketCAN format of Linux."""


@contextmanager
def foreign_errors_renamed(where: str) -> Iterator[None]:
    """Convert exceptions of python-can, pyserial and the system to acquisition errors.

    A missing driver becomes ConfigError, a lost bus LinkError, and an invalid value FrameError; the
    messages begin with `where`, the name of the bus.
    """
    try:
        yield
    except AcquisitionError:
        raise
    except can.CanInterfaceNotImplementedError as exc:
        raise ConfigError(f"{where}: {exc}") from exc
    except (can.CanError, SerialException, OSError, EOFError) as exc:
        raise LinkError(f"{where}: {exc or type(exc).__name__}") from exc
    except ValueError as exc:
        raise FrameError(f"{where}: {exc}") from exc


def open_bus(settings: CanLinkSettings, ids: Iterable[int]) -> can.BusABC:
    """Open a CAN bus for listening, and return its python-can object.

    Only frames with the given ids are received, both standard and extended ones, so that a wrong
    kind of id is detected.

    Raises
    ------
    LinkError
        If the bus is not available now.
    ConfigError
        If the interface is not supported on this system, or rejects its options.
    """
    where = str(settings)
    with foreign_errors_renamed(where):
        try:
            return _opened(settings, sorted(set(ids)))
        except OSError as exc:
            if exc.errno == _NO_SUCH_FAMILY:
                raise ConfigError(
                    f"{where}: the kernel does not support SocketCAN; load its CAN modules or use"
                    " another interface"
                ) from exc
            if exc.errno is None:  # the vendor's library is not installed
                raise ConfigError(f"{where}: {exc}") from exc
            raise
        except (ValueError, TypeError, NotImplementedError, NameError, AttributeError) as exc:
            # python-can's interfaces raise any of these for invalid arguments or missing vendor
            # libraries
            if isinstance(exc, can.CanError | UnicodeError):
                raise
            raise ConfigError(f"{where}: bus cannot be opened with these settings: {exc}") from exc


def _opened(settings: CanLinkSettings, ids: list[int]) -> can.BusABC:
    if settings.interface == "slcan":
        return SlcanBus(settings.channel, frozenset(ids), **_slcan_options(settings))
    speed = {"bitrate": settings.bitrate, "fd": settings.fd, "data_bitrate": settings.data_bitrate}
    options: dict[str, Any] = {**settings.options, **{k: v for k, v in speed.items() if v}}
    if settings.interface in _FILTERED_BY_KERNEL:
        options["can_filters"] = [{"can_id": i, "can_mask": _ID_MASK} for i in ids]
    return can.Bus(
        channel=settings.channel, interface=settings.interface, ignore_config=True, **options
    )


def _slcan_options(settings: CanLinkSettings) -> dict[str, Any]:
    """Return the slcan options; listen-only by default, but some buses need acknowledgement."""
    SlcanBus.require_speed(settings.bitrate, settings.data_bitrate)
    options: dict[str, Any] = {"listen_only": True}
    if "://" in settings.channel:
        options["sleep_after_open"] = 0.0
    options |= settings.options
    if settings.data_bitrate is not None and settings.bitrate is not None:
        options["timing"] = can.BitTimingFd.from_sample_point(
            f_clock=_SLCAN_CLOCK_HZ,
            nom_bitrate=settings.bitrate,
            nom_sample_point=_SAMPLE_POINT_PERCENT,
            data_bitrate=settings.data_bitrate,
            data_sample_point=_SAMPLE_POINT_PERCENT,
        )
    elif settings.bitrate is not None:
        options["bitrate"] = settings.bitrate
    return options
