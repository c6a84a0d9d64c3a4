"""Certificates, looked at before Zenoh does: it says only that a connection timed out, whatever was wrong with them."""

from __future__ import annotations

import socket
import ssl
from dataclasses import dataclass
from pathlib import Path

from agvbench.errors import FileError

_PATIENCE_S = 1.0
_ENDS = ("listen", "connect")


@dataclass(frozen=True)
class Certificates:
    """The files that a configuration names, for ``source`` (the configuration itself) in messages."""

    source: Path
    root_ca_certificate: Path | None = None
    listen_certificate: Path | None = None
    listen_private_key: Path | None = None
    connect_certificate: Path | None = None
    connect_private_key: Path | None = None

    def pair(self, end: str) -> tuple[Path | None, Path | None]:
        """Return certificate and key of one end, ``"listen"`` or ``"connect"``."""
        return getattr(self, f"{end}_certificate"), getattr(self, f"{end}_private_key")


def trusting(authority: Path | None) -> ssl.SSLContext:
    """Return a TLS context that trusts the authority with this certificate, and no other.

    Raises
    ------
    FileError
        If the file is missing, or no certificate.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    if authority is not None:
        try:
            context.load_verify_locations(authority)
        except (OSError, ValueError) as error:
            raise _unusable("certificate of the authority", authority, error) from None
    return context


def check_certificates(certificates: Certificates) -> None:
    """Raise `FileError` if a file is missing or no certificate, or a key is not that of its certificate."""
    context = trusting(certificates.root_ca_certificate)
    for end in _ENDS:
        certificate, key = certificates.pair(end)
        if (certificate is None) != (key is None):
            lone = "certificate without its key" if key is None else "key without its certificate"
            raise FileError(
                lone, where=f"{certificates.source}: {end}", remedy=f"name both: {end}_certificate and _key"
            )
        if certificate is not None:
            _load(context, certificate, key)


def why_not(certificates: Certificates, host: str, port: int) -> str:
    """Return why a server at `host` does not take us, or we not it; "" if nothing is wrong with the handshake."""
    context = trusting(certificates.root_ca_certificate)
    certificate, key = certificates.pair("connect")
    if certificate is not None:
        _load(context, certificate, key)
    try:
        with (
            socket.create_connection((host, port), _PATIENCE_S) as plain,
            context.wrap_socket(plain, server_hostname=host) as secured,
        ):
            # In TLS 1.3 a server says what it thinks of our certificate after the handshake.
            secured.recv(1)
    except ssl.SSLCertVerificationError as error:
        return f"its certificate: {error.verify_message}"
    except ssl.SSLError as error:
        return _in_words(error)
    except (OSError, UnicodeError):
        return ""
    return ""


def _load(context: ssl.SSLContext, certificate: Path, key: Path | None) -> None:
    try:
        # A key that is encrypted cannot be used by Zenoh; without an answer here, Python would ask for its password.
        context.load_cert_chain(certificate, key, password=lambda: "")
    except (OSError, ValueError) as error:
        where = f"{certificate} and {key}"
        for file in filter(None, (certificate, key)):
            if not file.is_file():
                where = str(file)
        raise _unusable("certificate and key", where, error) from None


def _unusable(what: str, where: object, error: OSError | ValueError) -> FileError:
    reason = str(error)  # of a ValueError: no path has a zero byte in it
    if isinstance(error, ssl.SSLError):
        reason = _in_words(error)
    elif isinstance(error, OSError):
        reason = error.strerror or reason
    where = str(where).replace("\0", "\\0")
    return FileError(f"{what} cannot be used", where=where, value=reason, remedy="see docs/how-to/secure-the-bus.md")


def _in_words(error: ssl.SSLError) -> str:
    return (error.reason or str(error)).lower().replace("_", " ")
