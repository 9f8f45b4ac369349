"""Which Modbus device is the right one, in the plant file."""

import pytest
from pydantic import TypeAdapter, ValidationError

from acquisition.modbus.identity import ExpectedIdentification, Signature
from service.settings.modbus_identity import IdentitySettings
from service.wiring.modbus_identity import identity_of

IDENTITY: TypeAdapter[IdentitySettings] = TypeAdapter(IdentitySettings)


def test_an_identity_reaches_the_adapter_as_it_was_written() -> None:
    signature = {"kind": "signature", "address": 1000, "words": [0x0102, 7], "function": 4}
    assert identity_of(IDENTITY.validate_python(signature)) == Signature(
        address=1000, words=(0x0102, 7), function=4
    )
    identification = {"kind": "identification", "vendor": "Acme", "revision": "1.4"}
    assert identity_of(IDENTITY.validate_python(identification)) == ExpectedIdentification(
        vendor="Acme", revision="1.4"
    )
    assert identity_of(None) is None


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"kind": "signature", "address": 0, "words": []}, "at least 1 item"),
        ({"kind": "signature", "address": 0, "words": [65_536]}, "less than or equal to 65535"),
        ({"kind": "signature", "address": 65_535, "words": [1, 2]}, "beyond register 65535"),
        ({"kind": "signature", "address": 0, "words": [1], "function": 6}, "should be 3 or 4"),
        ({"kind": "identification"}, "needs vendor, product_code or revision"),
        ({"kind": "face"}, "'signature', 'identification'"),
    ],
)
def test_an_identity_that_cannot_be_is_refused(wrong: dict[str, object], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        IDENTITY.validate_python(wrong)
