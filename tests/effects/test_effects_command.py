"""``agvbench effects`` and ``agvbench effects new``."""

from __future__ import annotations

from agvbench.cli import main
from agvbench.effects import effect_kinds
from agvbench.reporting.console.effects import reference_page


def test_lists_every_effect_with_its_parameters(capsys):
    assert main(["effects"]) == 0
    listed = capsys.readouterr().out
    for name, kind in effect_kinds().items():
        assert name in listed
        assert all(p.name in listed for p in kind.parameters())


def test_markdown_is_the_reference_page(capsys):
    assert main(["effects", "--markdown"]) == 0
    assert capsys.readouterr().out == reference_page()


def test_new_writes_a_file_once(tmp_path, capsys):
    command = ["effects", "new", "made_up_by_a_test", "--dir", str(tmp_path)]
    assert main(command) == 0
    assert "class MadeUpByATest(Effect):" in (tmp_path / "made_up_by_a_test.py").read_text(encoding="utf-8")
    assert main(command) == 2
    assert capsys.readouterr().err == (
        f"agvbench effects: {tmp_path / 'made_up_by_a_test.py'}: exists already; choose another name\n"
    )


def test_new_writes_the_hook_that_is_asked_for(tmp_path, capsys):
    command = ["effects", "new", "made_up_by_a_test", "--dir", str(tmp_path), "--hook"]
    assert main([*command, "moves"]) == 2
    assert capsys.readouterr().err == (
        "agvbench effects: --hook: no such hook: moves "
        "(one of: arrive, aim, adopt, steer, drive, move, drift, capture, see)\n"
    )
    assert main([*command, "move"]) == 0
    text = (tmp_path / "made_up_by_a_test.py").read_text(encoding="utf-8")
    assert "from agvbench.effects.state import FORWARD, LEFT\n" in text
    assert "Stage.BODY" in text
    assert "def move(state: Floats, gain: float) -> None:" in text
    assert "docs/how-to/write-an-effect.md" in capsys.readouterr().out


def test_names_that_cannot_be(tmp_path, capsys):
    for name in ("Warm", "warm-up", "class", "", "steering_lag"):
        assert main(["effects", "new", name, "--dir", str(tmp_path)]) == 2
        assert capsys.readouterr().err.startswith("agvbench effects: NAME: ")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_there(tmp_path, capsys):
    assert main(["effects", "new", "seam", "--dir", str(tmp_path / "none")]) == 2
    assert "cannot be written (No such file or directory); choose another --dir" in capsys.readouterr().err
