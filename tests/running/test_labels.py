"""Labels and stated uncertainties: from the option and ``lab.toml`` into the campaign, compare and history."""

import subprocess
import sys
from pathlib import Path

import pytest

from agvbench.campaign import Campaign
from agvbench.campaign.header import CampaignHeader
from agvbench.cli import main
from agvbench.errors import CampaignError, FileError
from agvbench.labels import checked_labels
from agvbench.running.configuration.lab_file import LabFile
from agvbench.running.configuration.vehicles import with_lab_vehicle
from agvbench.workflows.comparison.comparability import comparability
from agvbench.workflows.history.facts import changed, facts_of
from agvbench.workflows.init import make_lab

BENCH = ["bench", "trajectories", "--trajectories", "1", "--repeats", "1", "--no-report", "-k", "uncalibrated"]


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Return a lab folder with ``lab.toml`` and two campaigns, ``monday`` and ``tuesday``."""
    folder = tmp_path_factory.mktemp("labels") / "lab"
    make_lab(folder)
    text = (folder / "lab.toml").read_text(encoding="utf-8")
    text = text.replace('# tyres = "new" ', 'tyres = "new" ').replace("# camera_position_mm", "camera_position_mm")
    (folder / "lab.toml").write_text(text, encoding="utf-8")
    _run(folder, *BENCH, "--out", "monday")
    _run(folder, *BENCH, "--out", "tuesday", "--label", "tyres=worn", "--label", "carpet=2")
    # What is resumed keeps what it began with, whatever the lab states now.
    (folder / "lab.toml").write_text("[labels]\ndriver = 'other'\n", encoding="utf-8")
    _run(folder, "bench", "--no-report", "--resume", "--out", "tuesday")
    return folder


def _run(folder, *arguments, expected=0):
    """Run a command in a process of its own (other tests' sessions have loaded other folders); return what it said."""
    command = [sys.executable, "-m", "agvbench", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == expected, done.stdout + done.stderr
    return done.stderr


def test_labels_and_statements_travel_into_the_campaign(lab):
    monday, tuesday = (CampaignHeader.load(lab / name / "campaign.toml") for name in ("monday", "tuesday"))
    assert monday.labels == {"tyres": "new"}
    assert monday.uncertainty == tuesday.uncertainty == {"camera_position_mm": 0.3}
    assert tuesday.labels == {"tyres": "worn", "carpet": "2"}


def test_differing_labels_are_noted_by_compare_and_history(lab):
    monday, tuesday = lab / "monday", lab / "tuesday"
    notes = comparability(Campaign.open(monday), Campaign.open(tuesday)).notes
    assert "The labels differ: tyres new and worn, carpet none and 2." in notes
    phrases = list(changed(facts_of(monday, ""), facts_of(tuesday, "")))
    assert "label tyres new → worn" in phrases
    assert "label carpet  → 2" in phrases


def test_a_resumed_session_refuses_another_label(lab):
    said = _run(lab, "bench", "--no-report", "--resume", "--out", "tuesday", "--label", "tyres=new", expected=2)
    assert "--label: a resumed session drives what it began with" in said


def test_the_plant_of_the_lab_folder_is_simulated(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("lab.toml").write_text('[simulation]\nplant = "fast_car.py:make_car"\n', encoding="utf-8")
    assert main(["bench", "--dry-run"]) == 2
    assert "fast_car.py" in capsys.readouterr().err
    assert with_lab_vehicle({})["plant"] == "fast_car.py:make_car"
    assert with_lab_vehicle({"plant": "other.py:make"})["plant"] == "other.py:make"
    Path("lab.toml").write_text("[simulation]\nplant = 3\n", encoding="utf-8")
    assert main(["bench", "--dry-run"]) == 2
    assert "lab.toml: simulation.plant: value cannot be used: 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("tyres", "--label: is no label: 'tyres'; give NAME=VALUE"),
        ("=new", "--label: label has no such name: ''"),
        ("tyres=", "--label.tyres: label cannot be used: ''"),
        ("tyres=" + "x" * 81, "label cannot be used"),
    ],
)
def test_a_label_that_cannot_be_used_is_one_line(given, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["bench", "--dry-run", "--label", given]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[label]\nx = 1\n", "lab.toml: unknown key 'label'; did you mean 'labels'?"),
        ("[labels]\nx = true\n", "lab.toml: labels.x: label cannot be used: True"),
        ("[labels]\n'a b' = 1\n", "lab.toml: labels: label has no such name: 'a b'"),
        ("[uncertainty]\nclock_ms = 'slow'\n", "lab.toml: uncertainty: clock_ms: value cannot be used"),
        ("[labels\n", "lab.toml: is not TOML"),
    ],
)
def test_a_lab_file_that_cannot_be_used_is_one_line(text, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab.toml").write_text(text, encoding="utf-8")
    with pytest.raises(FileError) as error:
        LabFile.of_folder()
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_too_many_labels_are_refused():
    with pytest.raises(CampaignError, match="has too many labels: 33"):
        checked_labels({f"l{k}": k for k in range(33)}, where="labels", error=CampaignError)
