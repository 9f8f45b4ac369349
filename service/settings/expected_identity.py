"""The identity of a Modbus device, as the adapter takes it."""

from acquisition.modbus.identity import ExpectedIdentification, ExpectedRegisters, Identity
from service.settings.modbus_identity import (
    IdentificationIdentity,
    IdentitySettings,
    SignatureIdentity,
)


def identity_of(settings: IdentitySettings | None) -> Identity | None:
    """What the device must answer; None if any will do."""
    match settings:
        case SignatureIdentity():
            return ExpectedRegisters(
                address=settings.address, words=settings.words, function=settings.function
            )
        case IdentificationIdentity():
            return ExpectedIdentification(
                vendor=settings.vendor,
                product_code=settings.product_code,
                revision=settings.revision,
            )
        case None:
            return None
