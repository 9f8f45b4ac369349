"""Link to a Modbus device, and the identity expected of it."""

from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from service.settings.base import MisfitError, Settings

Word = Annotated[int, Field(ge=0, le=0xFFFF)]
IdentificationText = Annotated[str, StringConstraints(min_length=1, max_length=244)]


class SignatureIdentity(Settings):
    """Registers that never change in this device and differ in others: type, firmware, serial."""

    kind: Literal["signature"]
    """This way of telling devices apart."""

    address: Annotated[int, Field(ge=0, le=0xFFFF)]
    """Address of the first register, counted from 0; example: 1000."""

    words: Annotated[tuple[Word, ...], Field(min_length=1, max_length=125)]
    """What the registers contain, 0 to 65535 each; example: [0x0102, 0x0007]."""

    function: Literal[3, 4] = 3
    """Function code that reads them: 3 (holding) or 4 (input)."""

    @model_validator(mode="after")
    def _check_end(self) -> Self:
        if self.address + len(self.words) > 0x10000:
            raise MisfitError("goes beyond register 65535", "words")
        return self


class IdentificationIdentity(Settings):
    """The device's answer to function 43/14; what is not given may be anything."""

    kind: Literal["identification"]
    """This way of telling devices apart."""

    vendor: IdentificationText | None = None
    """Vendor name (object 0); example: "Acme"."""

    product_code: IdentificationText | None = None
    """Product code (object 1); example: "DAQ-12"."""

    revision: IdentificationText | None = None
    """Revision (object 2); example: "1.4"."""

    @model_validator(mode="after")
    def _check_any(self) -> Self:
        if self.vendor is None and self.product_code is None and self.revision is None:
            raise MisfitError("needs vendor, product_code or revision", "kind")
        return self


IdentitySettings = Annotated[
    SignatureIdentity | IdentificationIdentity, Field(discriminator="kind")
]


class ModbusLinkSettings(Settings):
    """A Modbus device on the network (host) or on a serial line (device)."""

    host: Annotated[str, StringConstraints(min_length=1, max_length=253)] | None = None
    """Address or name of a Modbus TCP device; example: "192.0.2.17"."""

    port: Annotated[int, Field(ge=0, le=65535)] = 502
    """TCP port; example: 502. 0 only for a simulated DAQ, which then takes a free one."""

    device: Annotated[str, StringConstraints(min_length=1, max_length=255)] | None = None
    """Serial port of a Modbus RTU line instead of a host; example: "/dev/ttyUSB0". "pty" only for a
    simulated DAQ, which then makes one."""

    baudrate: Annotated[int, Field(ge=1200, le=4_000_000)] = 115_200
    """Bits per second of the serial line; 12 channels at 600 Hz need 460800."""

    parity: Literal["none", "even", "odd"] = "even"
    """Parity of the serial line."""

    stop_bits: Literal[1, 2] = 1
    """Stop bits of the serial line: 1, or 2 where parity is "none"."""

    device_id: Annotated[int, Field(ge=1, le=255)] = 1
    """Modbus unit identifier, 1 to 255; on a serial line at most 247."""

    timeout_s: Annotated[float, Field(ge=0.05, le=60.0)] = 0.5
    """Longest wait for one reply in seconds, 0.05 to 60; a link that is silent for longer is
    lost. Two poll periods or less notice that within three."""

    identity: IdentitySettings | None = None
    """What the device must answer to be the right one, asked on each connection: kind "signature"
    (registers) or "identification" (function 43/14). Without it only the data's own form tells."""

    requests_in_flight: Annotated[int, Field(ge=1, le=16)] | None = None
    """Most requests that are sent before the first is answered, over TCP: 1 to 16. Without it six
    to a block ring, and one to any other device, as some lose all but one. A device that does not
    answer them in order is asked one at a time from then on. `padwatch probe in-flight` tries."""

    @model_validator(mode="after")
    def _check_link(self) -> Self:
        if (self.host is None) == (self.device is None):
            found = "neither" if self.host is None else "both"
            raise MisfitError(
                f"host (Modbus TCP) or device (serial line) must be given, found {found}", "host"
            )
        if self.device is not None and self.device_id > 247:
            raise MisfitError("on a serial line must be 1 to 247", "device_id")
        if self.device is not None and (self.requests_in_flight or 1) > 1:
            raise MisfitError("must be 1 on a serial line", "requests_in_flight")
        return self
