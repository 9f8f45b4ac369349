"""TLS of the HTTP server itself."""

import ssl
from pathlib import Path


class CertificateError(Exception):
    """A certificate or its key cannot be used; the message says which and why."""


def server_tls(certificate: Path, key: Path) -> ssl.SSLContext:
    """Read a certificate and its key; TLS 1.2 or newer.

    Raises
    ------
    CertificateError
        If a file cannot be read, is none, or the two do not belong together.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.set_alpn_protocols(["http/1.1"])
    for path in (certificate, key):
        _require_readable(path)
    try:
        # an empty passphrase, or OpenSSL would ask for one on the terminal
        context.load_cert_chain(certificate, key, password="")
    except (ssl.SSLError, ValueError) as error:
        why = getattr(error, "reason", None) or str(error)
        raise CertificateError(
            f"service.tls: {certificate} and {key} are no certificate and its key: {why}"
        ) from error
    return context


def _require_readable(path: Path) -> None:
    try:
        with path.open("rb") as file:
            file.read(1)
    except OSError as error:
        raise CertificateError(f"service.tls: {path}: {error.strerror}") from error
