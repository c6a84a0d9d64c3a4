"""The header that `agvbench calibrate --firmware` writes is one the firmware's sources take."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from agvbench.errors import FileError
from agvbench.model import thesis_vehicle
from agvbench.workflows.calibration import firmware_header, write_firmware_header


def test_a_name_cannot_break_out_of_the_comment() -> None:
    header = firmware_header(replace(thesis_vehicle(), name='evil */ "\n#error'))
    assert header.count("*/") == 1
    assert header.count("\n") == 2
    assert f'"{thesis_vehicle().calibration_hash}"' in header


def test_what_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="give --firmware a place you may write to"):
        write_firmware_header(thesis_vehicle(), tmp_path)


def test_the_compiler_takes_it(firmware: Path, tmp_path: Path) -> None:
    model, header = thesis_vehicle(), tmp_path / "vehicle.h"
    write_firmware_header(model, header)
    compiler = ["avr-gcc", "-mmcu=atmega328p", "-DVERSION=2", "-DF_CPU=16000000UL", "-std=c99", "-Os", "-S", "-o", "-"]
    done = subprocess.run(
        [*compiler, "-include", header, firmware / "src" / "protocol.c"],
        check=True,
        capture_output=True,
        text=True,
    )
    assert f"V agvbench 2 1 us {model.calibration_hash}" in done.stdout
