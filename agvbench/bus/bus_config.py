"""A lab's own Zenoh configuration: certificates, access rights, limits; in Zenoh's own words (JSON5).

The endpoints to listen on and to connect to stay with the command line: no file opens the vehicle to a network unasked.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agvbench.bus.certificates import Certificates, check_certificates
from agvbench.errors import FileError
from agvbench.text_files import read_text

if TYPE_CHECKING:
    import zenoh

MAX_BYTES = 256 << 10
_TLS = "transport/link/tls"
_PATHS = (
    "root_ca_certificate",
    "listen_certificate",
    "listen_private_key",
    "connect_certificate",
    "connect_private_key",
)
_OURS = {
    "listen": "--listen",
    "connect": "--connect",
    "mode": "--listen and --connect",
    "scouting": "--listen and --connect: there is no scouting",
}
_PLACE = re.compile(r"--> (\d+):(\d+)")


@dataclass(frozen=True)
class BusConfig:
    """What a configuration file says.

    ``certificates`` are its TLS files, made absolute: relative ones lie beside the file. ``requires_certificate`` says
    whether endpoints of TLS and QUIC take only peers that show a certificate of the lab's own authority.
    """

    path: Path
    text: str
    certificates: Certificates
    requires_certificate: bool

    @classmethod
    def load(cls, path: str | Path) -> BusConfig:
        """Read and check a file.

        Raises
        ------
        FileError
            If it cannot be read, is too long or no configuration of Zenoh's, says what belongs on the command line, or
            names certificates that cannot be used.
        """
        path = Path(path)
        try:
            text = read_text(path, max_bytes=MAX_BYTES)
        except OSError as error:
            raise FileError("cannot be read", where=path, value=error.strerror) from None
        except UnicodeDecodeError:
            raise FileError("is not UTF-8 text", where=path) from None
        parsed = _parse(text, path)
        _refuse_ours(parsed, path)
        tls = json.loads(parsed.get_json(_TLS))
        named = {name: (path.parent / tls[name]).absolute() for name in _PATHS if tls.get(name)}
        certificates = Certificates(path, **named)
        check_certificates(certificates)
        return cls(path, text, certificates, requires_certificate=bool(tls.get("enable_mtls")))

    def settings(self) -> zenoh.Config:
        """Return the configuration, as Zenoh has it, to be added to."""
        settings: zenoh.Config = _parse(self.text, self.path)
        for name in _PATHS:
            if (file := getattr(self.certificates, name)) is not None:
                settings.insert_json5(f"{_TLS}/{name}", json.dumps(str(file)))
        return settings


def _parse(text: str, path: Path) -> Any:
    import zenoh

    try:
        return zenoh.Config.from_json5(text)
    except zenoh.ZError as error:
        place = _PLACE.search(str(error))
        where = f"{path}: line {place[1]}, column {place[2]}" if place else path
        reason = str(error).strip().splitlines()[-1].strip(" =")
        raise FileError(
            "is no configuration of Zenoh's", where=where, value=reason, remedy="see docs/how-to/secure-the-bus.md"
        ) from None


def _refuse_ours(parsed: Any, path: Path) -> None:
    import zenoh

    usual = zenoh.Config.from_json5("{}")
    for key, flag in _OURS.items():
        if parsed.get_json(key) != usual.get_json(key):
            raise FileError("says what belongs on the command line", where=path, value=key, remedy=f"use {flag}")
