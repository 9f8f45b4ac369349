"""Settings of links that cannot be are refused with the value and what is allowed."""

import pytest

from acquisition.errors import ConfigError
from acquisition.modbus.ring_source import ModbusRingSettings
from acquisition.modbus.transport import (
    ConnectionUse,
    LinkSettings,
    SerialTransport,
    TcpTransport,
)

TCP = TcpTransport(host="127.0.0.1")
LINE = SerialTransport(device="/dev/ttyUSB0")


@pytest.mark.parametrize(
    ("kind", "wrong", "complaint"),
    [
        (TcpTransport, {"host": "daq", "port": 0}, "port is 0, allowed is 1 to 65535"),
        (SerialTransport, {"device": "/dev/tty", "baudrate": 299}, "baudrate is 299, allowed is"),
        (SerialTransport, {"device": "/dev/tty", "parity": "mark"}, "parity is 'mark', allowed"),
        (SerialTransport, {"device": "/dev/tty", "stop_bits": 3}, "stop_bits is 3, allowed is 1"),
        (
            LinkSettings,
            {"transport": TCP, "device_id": 256},
            "device_id is 256, allowed is 1 to 255",
        ),
        (
            LinkSettings,
            {"transport": LINE, "device_id": 248},
            "device_id is 248, allowed is 1 to 247",
        ),
        (
            LinkSettings,
            {"transport": TCP, "max_registers": 126},
            "max_registers is 126, allowed is 1",
        ),
        (LinkSettings, {"transport": TCP, "timeout_s": 0.0}, "timeout_s is 0.0"),
        (LinkSettings, {"transport": TCP, "timeout_s": float("nan")}, "timeout_s is nan"),
        (
            LinkSettings,
            {"transport": LINE, "connection": ConnectionUse.PER_REPLY},
            "serial line is kept",
        ),
        (
            ModbusRingSettings,
            {"transport": TCP, "function": 6},
            "function is 6, allowed are 3 and 4",
        ),
        (ModbusRingSettings, {"transport": TCP, "base_address": 65521}, "allowed is 0 to 65520"),
        (
            ModbusRingSettings,
            {"transport": TCP, "poll_period_s": 0.0},
            "poll_period_s is 0.0, must",
        ),
        (
            ModbusRingSettings,
            {"transport": TCP, "stale_after_s": float("inf")},
            "stale_after_s is inf",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_value_and_limit(kind, wrong, complaint):
    with pytest.raises(ConfigError, match=complaint):
        kind(**wrong)
