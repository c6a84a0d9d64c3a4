"""Configurations of the bus: whatever cannot be used is one line that names the file and what to do."""

from __future__ import annotations

import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from agvbench.bus.bus_config import MAX_BYTES, BusConfig
from agvbench.bus.session import is_open_to_all, open_bus_session
from agvbench.errors import FileError, LinkError


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "bus.json5"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", r"line 1, column 2: is no configuration of Zenoh's: expected"),
        ("", r"line 1, column 1: is no configuration"),
        ("{tansport: {}}", "unknown field `tansport`"),
        ('{transport: {link: {tls: {enable_mtls: "yes"}}}}', "expected a boolean"),
        ('{listen: {endpoints: ["tcp/0.0.0.0:7447"]}}', "belongs on the command line: listen; use --listen"),
        ('{connect: {endpoints: ["tcp/10.0.0.1:7447"]}}', "belongs on the command line: connect; use --connect"),
        ('{mode: "router"}', "belongs on the command line: mode"),
        ("{scouting: {multicast: {enabled: true}}}", "belongs on the command line: scouting"),
        ('{transport: {link: {tls: {root_ca_certificate: "no.pem"}}}}', "no.pem: .*cannot be used: No such file"),
        ('{transport: {link: {tls: {root_ca_certificate: "bus.json5"}}}}', "authority cannot be used: no certificate"),
        ('{transport: {link: {tls: {root_ca_certificate: "a\\u0000.pem"}}}}', r"a\\0.pem: .*embedded null byte"),
        ('{transport: {link: {tls: {connect_certificate: "a.pem"}}}}', "certificate without its key"),
        (
            '{transport: {link: {tls: {listen_certificate: "a.pem", listen_private_key: "a.key"}}}}',
            "a.key: certificate and key cannot be used: No such file",
        ),
        ("[" * 5000, "is nested too deep"),
        (b"\xff\xfe", "is not UTF-8 text"),
        (" " * (MAX_BYTES + 1), "is too long"),
    ],
)
def test_what_cannot_be_used_is_told_in_one_line(tmp_path: Path, text: str | bytes, told: str) -> None:
    with pytest.raises(FileError, match=told) as caught:
        BusConfig.load(written(tmp_path, text))
    assert str(tmp_path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates")
def test_a_key_that_is_another_certificates(tmp_path: Path) -> None:
    for name in ("a", "b"):
        curve = "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -noenc"
        made = f"openssl req -x509 {curve} -subj /CN=x -days 1 -keyout {name}.key -out {name}.pem"
        subprocess.run(shlex.split(made), cwd=tmp_path, check=True, capture_output=True)
    mixed = '{transport: {link: {tls: {listen_certificate: "a.pem", listen_private_key: "b.key"}}}}'
    with pytest.raises(FileError, match="certificate and key cannot be used: key values mismatch"):
        BusConfig.load(written(tmp_path, mixed))
    right = BusConfig.load(written(tmp_path, mixed.replace("b.key", "a.key")))
    assert not right.requires_certificate
    assert is_open_to_all("tls/0.0.0.0:7447", right)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be read: No such file"):
        BusConfig.load(tmp_path / "bus.json5")


def test_secured_endpoints_need_a_configuration() -> None:
    for end in ("listen", "connect"):
        with pytest.raises(LinkError, match=f"{end} tls/127.0.0.1:7447: needs certificates; .*--bus-config FILE"):
            open_bus_session(**{end: ["tls/127.0.0.1:7447"]})


def test_who_is_asked_is_what_the_configuration_says(tmp_path: Path) -> None:
    asking = BusConfig.load(written(tmp_path, "{transport: {link: {tls: {enable_mtls: true}}}}"))
    assert not is_open_to_all("tls/0.0.0.0:7447", asking)
    assert is_open_to_all("tcp/0.0.0.0:7447", asking)
    assert is_open_to_all("tls/0.0.0.0:7447", None)
    with pytest.raises(LinkError, match="let other machines drive the vehicle"):
        open_bus_session(listen=["tcp/0.0.0.0:7447"], config=asking)


def test_rules_that_contradict_themselves_are_one_line(tmp_path: Path) -> None:
    rule = '{id: "a", permission: "allow", messages: ["put"], key_exprs: ["x"]}'
    policies = '[{rules: ["b"], subjects: ["c"]}]'
    rules = f'{{access_control: {{enabled: true, rules: [{rule}], subjects: [{{id: "c"}}], policies: {policies}}}}}'
    with pytest.raises(LinkError, match="'b'") as caught:
        open_bus_session(config=BusConfig.load(written(tmp_path, rules)))
    assert ".rs" not in str(caught.value)
