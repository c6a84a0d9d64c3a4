"""The same sources give the same bytes, and the vehicle says which calibration it was built for."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from agvbench.errors import FileError, LinkError

LARGEST_FLASH, LARGEST_MEMORY = 32 * 1024, 2 * 1024


def build(source: Path, to: Path, *arguments: str) -> Path:
    shutil.copytree(source, to, ignore=shutil.ignore_patterns("build"))
    subprocess.run(["make", "-s", "-C", to, "firmware", *arguments], check=True, stdout=subprocess.DEVNULL)
    return to / "build"


@pytest.mark.parametrize("name", ["agv1.elf", "agv2.elf"])
def test_builds_do_not_depend_on_where_and_when(firmware: Path, tmp_path: Path, name: str) -> None:
    elsewhere = build(firmware, tmp_path / "some" / "other" / "place")
    assert (elsewhere / name).read_bytes() == (firmware / "build" / name).read_bytes()


def test_both_fit_the_microcontroller(firmware: Path) -> None:
    for name in ("agv1.elf", "agv2.elf"):
        said = subprocess.run(
            ["avr-size", firmware / "build" / name], check=True, capture_output=True, text=True
        ).stdout
        text, data, bss = map(int, said.splitlines()[1].split()[:3])
        assert text + data < LARGEST_FLASH
        assert data + bss < LARGEST_MEMORY / 2  # the rest is the stack's


def test_the_calibration_it_was_built_for_is_in_it(firmware: Path, tmp_path: Path) -> None:
    header = tmp_path / "mine.h"
    header.write_text('#define CALIBRATION_HASH "0123456789abcdef"\n')
    assert (
        b"V agvbench 2 1 us 0123456789abcdef"
        in (build(firmware, tmp_path / "firmware", f"CALIBRATION={header}") / "agv2.elf").read_bytes()
    )


def test_what_cannot_be_built_is_one_line(firmware: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from agvbench.workflows import firmware_build

    with pytest.raises(FileError, match=r"none\.h: no such file; agvbench calibrate DIR --firmware FILE\.h writes one"):
        firmware_build.build_firmware(tmp_path / "none.h", tmp_path / "out")
    (bad := tmp_path / "bad.h").write_text("#error not a header of ours\n")
    with pytest.raises(LinkError, match=r"the sources cannot be built: .*not a header of ours"):
        firmware_build.build_firmware(bad, tmp_path / "out")
    (file := tmp_path / "file").touch()
    with pytest.raises(FileError, match=r"cannot be written: .*; give --out"):
        firmware_build.build_firmware(None, file)
    monkeypatch.setattr(firmware_build, "missing_packages", lambda: ["gcc-avr", "avr-libc"])
    with pytest.raises(LinkError, match="tools are missing: gcc-avr avr-libc; on Debian: sudo apt-get install gcc-avr"):
        firmware_build.build_firmware(None, tmp_path / "out")


def test_a_header_that_is_not_utf_8_and_a_directory_that_leads_to_itself_are_one_line(
    firmware: Path, tmp_path: Path
) -> None:
    from agvbench.workflows.firmware_build import build_firmware

    header, loop = tmp_path / "latin.h", tmp_path / "loop"
    header.write_bytes(b"#error \xe9\n")
    loop.symlink_to(loop)
    with pytest.raises(LinkError, match="the sources cannot be built"):
        build_firmware(header, tmp_path / "out")
    with pytest.raises(FileError, match="cannot be written"):
        build_firmware(None, loop)
