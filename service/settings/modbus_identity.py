"""Which Modbus device is the right one: what it must answer before samples are read from it."""

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
