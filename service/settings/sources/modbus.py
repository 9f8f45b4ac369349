"""Settings of the link to a Modbus device, and of the expected identity of the device."""

from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from service.settings.base import MisfitError, Settings

Word = Annotated[int, Field(ge=0, le=0xFFFF)]
IdentificationText = Annotated[str, StringConstraints(min_length=1, max_length=244)]


class SignatureIdentity(Settings):
    """Expected content of constant registers that identify a device, such as its serial number."""

    kind: Literal["signature"]
    """Kind of the identity, always "signature"."""

    address: Annotated[int, Field(ge=0, le=0xFFFF)]
    """Address of the first register, counted from 0; example: 1000."""

    words: Annotated[tuple[Word, ...], Field(min_length=1, max_length=125)]
    """Expected contents of the registers, 0 to 65535 each; example: [0x0102, 0x0007]."""

    function: Literal[3, 4] = 3
    """Modbus function code of the registers: 3 (holding) or 4 (input)."""

    @model_validator(mode="after")
    def _check_end(self) -> Self:
        if self.address + len(self.words) > 0x10000:
            raise MisfitError("must not extend beyond register 65535", "words")
        return self


class IdentificationIdentity(Settings):
    """Expected device identification (function 43/14); objects that are not set are not checked."""

    kind: Literal["identification"]
    """Kind of the identity, always "identification"."""

    vendor: IdentificationText | None = None
    """Vendor name (object 0); example: "Acme"."""

    product_code: IdentificationText | None = None
    """Product code (object 1); example: "DAQ-12"."""

    revision: IdentificationText | None = None
    """Revision (object 2); example: "1.4"."""

    @model_validator(mode="after")
    def _check_any(self) -> Self:
        if self.vendor is None and self.product_code is None and self.revision is None:
            raise MisfitError("vendor, product_code or revision must be given", "kind")
        return self


IdentitySettings = Annotated[
    SignatureIdentity | IdentificationIdentity, Field(discriminator="kind")
]


class ModbusLinkSettings(Settings):
    """Settings of the link to a Modbus device, by TCP (host) or serial line (device)."""

    host: Annotated[str, StringConstraints(min_length=1, max_length=253)] | None = None
    """IP address or host name of a Modbus TCP device; example: "192.0.2.17"."""

    port: Annotated[int, Field(ge=0, le=65535)] = 502
    """TCP port of the device; example: 502. With 0 a free port is used, for a simulated DAQ
    only."""

    device: Annotated[str, StringConstraints(min_length=1, max_length=255)] | None = None
    """Serial port of a Modbus RTU line, instead of host; example: "/dev/ttyUSB0". With "pty" a
    pseudo-terminal is created, for a simulated DAQ only."""

    baudrate: Annotated[int, Field(ge=1200, le=4_000_000)] = 115_200
    """Bit rate of the serial line, bit/s; 12 channels at 600 Hz require 460800."""

    parity: Literal["none", "even", "odd"] = "even"
    """Parity of the serial line."""

    stop_bits: Literal[1, 2] = 1
    """Number of stop bits of the serial line: 1, or 2 if parity is "none"."""

    device_id: Annotated[int, Field(ge=1, le=255)] = 1
    """Modbus unit identifier, 1 to 255; on a serial line at most 247."""

    timeout_s: Annotated[float, Field(ge=0.05, le=60.0)] = 0.5
    """Time-out of a reply, s, 0.05 to 60, after which the link counts as lost. With a time-out of
    at most two poll periods, a loss is detected within three poll periods."""

    identity: IdentitySettings | None = None
    """Expected identity of the device, checked on each connection: kind "signature" (registers) or
    "identification" (function 43/14). By default only the format of the data is checked."""

    requests_in_flight: Annotated[int, Field(ge=1, le=16)] | None = None
    """Maximum number of pending requests over TCP, 1 to 16; by default 16 for a block ring and one
    for other devices, because some devices support only one. After a wrong reply, or two
    interruptions in succession, requests are sent one at a time from then on. `padwatch probe
    in-flight` measures the number that a device supports."""

    @model_validator(mode="after")
    def _check_link(self) -> Self:
        if (self.host is None) == (self.device is None):
            found = "neither" if self.host is None else "both"
            raise MisfitError(
                "exactly one of host (Modbus TCP) and device (serial line) must be given, found"
                f" {found}",
                "host",
            )
        if self.device is not None and self.device_id > 247:
            raise MisfitError("must be 1 to 247 on a serial line", "device_id")
        if self.device is not None and (self.requests_in_flight or 1) > 1:
            raise MisfitError("must be 1 on a serial line", "requests_in_flight")
        return self
