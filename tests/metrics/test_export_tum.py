"""Exported TUM files: driven and planned poses of every run that counts, as evo reads them."""

from __future__ import annotations

import numpy as np
import pytest
from own_campaigns import line_campaign

from agvbench.errors import FileError
from agvbench.workflows.exchange.export_tum import export_tum


def test_files_hold_time_position_and_heading_in_the_start_frame(tmp_path):
    campaign = line_campaign(tmp_path / "camp")
    done = export_tum(campaign, tmp_path / "tum")
    assert {file.relative_to(tmp_path / "tum").as_posix() for file in done.files} >= {
        "driven/trajectory%2F1.tum",
        "planned/trajectory%2F1.tum",
    }
    driven, planned = (np.loadtxt(tmp_path / "tum" / kind / "trajectory%2F1.tum") for kind in ("driven", "planned"))
    assert driven.shape[1] == planned.shape[1] == 8
    assert driven[0, :3] == pytest.approx(0.0, abs=1e-9)
    assert driven[-1, 1:3] == pytest.approx([2.0, 0.0], abs=1e-6)
    assert np.hypot(driven[:, 6], driven[:, 7]) == pytest.approx(1.0)
    assert np.all(np.diff(driven[:, 0]) > 0.0)
    assert planned[-1, 1:3] == pytest.approx([2.0, 0.0], abs=1e-3)


def test_runs_without_a_start_are_left_out_and_said(tmp_path):
    campaign = line_campaign(tmp_path / "camp", rest_frames=0)
    assert export_tum(campaign, tmp_path / "tum").left_out == ["trajectory/1"]


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(FileError, match="cannot be written"):
        export_tum(line_campaign(tmp_path / "camp"), tmp_path / "file")
