"""Settings of links that cannot be are refused with the value and what is allowed."""

from functools import partial

import pytest

from acquisition.errors import ConfigError
from acquisition.modbus.ring_source import ModbusRingSettings
from acquisition.modbus.transport import ConnectionUse, LinkSettings, SerialTransport, TcpTransport

TCP = TcpTransport(host="127.0.0.1")
LINE = SerialTransport(device="/dev/ttyUSB0")
tcp, line = partial(TcpTransport, host="daq"), partial(SerialTransport, device="/dev/tty")
on_tcp, on_line = partial(LinkSettings, transport=TCP), partial(LinkSettings, transport=LINE)
ring = partial(ModbusRingSettings, transport=TCP)


@pytest.mark.parametrize(
    ("kind", "wrong", "complaint"),
    [
        (tcp, {"port": 0}, "port is 0, allowed is 1 to 65535"),
        (line, {"baudrate": 299}, "baudrate is 299, allowed is"),
        (line, {"parity": "mark"}, "parity is 'mark', allowed"),
        (line, {"stop_bits": 3}, "stop_bits is 3, allowed is 1"),
        (on_tcp, {"device_id": 256}, "device_id is 256, allowed is 1 to 255"),
        (on_line, {"device_id": 248}, "device_id is 248, allowed is 1 to 247"),
        (on_tcp, {"max_registers": 126}, "max_registers is 126, allowed is 1"),
        (on_tcp, {"timeout_s": 0.0}, "timeout_s is 0.0"),
        (on_tcp, {"timeout_s": float("nan")}, "timeout_s is nan"),
        (on_line, {"connection": ConnectionUse.PER_REPLY}, "serial line is kept"),
        (ring, {"function": 6}, "function is 6, allowed are 3 and 4"),
        (ring, {"base_address": 65521}, "allowed is 0 to 65520"),
        (ring, {"poll_period_s": 0.0}, "poll_period_s is 0.0, must"),
        (ring, {"stale_after_s": float("inf")}, "stale_after_s is inf"),
    ],
)
def test_what_cannot_be_is_refused_with_value_and_limit(kind, wrong, complaint):
    with pytest.raises(ConfigError, match=complaint):
        kind(**wrong)
