"""Certificates of an encrypted connection, looked at before it is opened: one line says which file is wrong."""

from __future__ import annotations

import ssl
from pathlib import Path

from agvbench.errors import FileError, FlagError
from agvbench.executors.executor import ExecutorOptions


def require_certificates(options: ExecutorOptions) -> None:
    """Check the files of an address ``tls://``.

    Raises
    ------
    FlagError
        If one of the three is not given.
    FileError
        If one of them is missing or no certificate, or the key is not that of the certificate.
    """
    files = {"--tls-ca-file": options.tls_ca_file, "--tls-cert": options.tls_cert, "--tls-key": options.tls_key}
    for flag, file in files.items():
        if file is None:
            raise FlagError("tls:// needs certificates", where=flag, remedy=f"add {flag} FILE")
        if not file.is_file():
            raise FileError("there is no such file", where=file, remedy=f"correct {flag}")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        context.load_verify_locations(options.tls_ca_file)
    except (OSError, ValueError) as error:
        raise _unusable(options.tls_ca_file, error) from None
    try:
        # Without an answer here, Python would ask for the password of an encrypted key.
        context.load_cert_chain(str(options.tls_cert), options.tls_key, password=lambda: "")
    except (OSError, ValueError) as error:
        raise _unusable(f"{options.tls_cert} and {options.tls_key}", error) from None


def _unusable(where: Path | str | None, error: OSError | ValueError) -> FileError:
    reason = getattr(error, "reason", None) or str(error)
    return FileError(
        "certificate cannot be used", where=where, value=reason, remedy="see docs/how-to/secure-the-bus.md"
    )
