"""At which addresses the service starts."""

import pytest

from service.security.addresses import Doorway, why_closed


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "::1", "localhost"])
def test_loopback_needs_no_login(host: str) -> None:
    assert why_closed(Doorway(host)) is None
    # a Unix socket is left to the proxy that opens it
    assert why_closed(Doorway("0.0.0.0", is_unix_socket=True)) is None  # noqa: S104


@pytest.mark.parametrize(
    "host",
    ["0.0.0.0", "::", "10.0.0.5", "plant.example", "127.0.0.1.example", "", "::ffff:10.0.0.5"],  # noqa: S104
)
def test_other_addresses_need_tls_and_an_account(host: str) -> None:
    assert why_closed(Doorway(host, has_tls=True, has_account=True)) is None
    for has_tls, has_account in ((False, False), (False, True), (True, False)):
        why = why_closed(Doorway(host, has_tls=has_tls, has_account=has_account))
        assert why is not None
        assert ("[service.tls]" in why, "users add" in why) == (not has_tls, not has_account)
        assert host in why
        assert "\n" not in why
