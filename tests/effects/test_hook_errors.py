"""A mistake in the file of an effect is one line that names the file, the line, the hook and the remedy."""

from __future__ import annotations

import pytest
from own_effect import PROGRAM, python, write

from agvbench.errors import FileError
from agvbench.model.simulation.hook_errors import check_hooks


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("kept = 1.0", "keptt = 1.0", (":32: hook move: name 'kept' is not defined; did you "
         "mean keptt? else define it, or import it from agvbench.effects.state")),
        ("*= kept", "*= half(kept)", (":32: hook move: can use neither functions nor objects "
         "of its file: half; write its equation into the hook; constants are numbers")),
        ("abs(state[FORWARD]", "math.copysign(state[FORWARD]", (":31: hook move: the "
         "compiler knows no such function of these types: copysign(float64); ")),
        ("*= kept", "= [kept, kept][0]", (":32: hook move: creates a list, an array or a "
         "text; use arithmetic, math and constants of the file only; see docs/how-to/write-an-effect.md")),
        ("*= kept\n", "*= kept\n        import os\n", (":33: hook move: cannot be compiled: "
         "Use of unsupported opcode (IMPORT_NAME) found; ")),
        ("[LEFT] *= kept", "[LEFT] *= kept\n        return kept", (":28: hook move: returns "
         "the wrong type: float64; change the state and return nothing")),
    ],
)  # fmt: skip
def test_a_hook_that_cannot_be_compiled_is_named_with_its_line(own, tmp_path, old, new, message):
    write(tmp_path, old, new)
    with pytest.raises(FileError) as caught:
        check_hooks(own().values())
    assert str(caught.value).startswith(f"effects/lateral_load_loss.py{message}")
    assert len(str(caught.value)) < 220


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("loss: float) -> None", "los: float) -> None", (":28: hook move: has other arguments than its effect: state, "
         "los; write def move(state, loss)")),
        ("Stage.BODY", "Stage.WHEELS", ": hook move: is no hook of the effect's stage: wheels (one of: body)"),
        ("    limits:", "    limit:", ": a class attribute is missing: limits; add it; see docs/"),
        ("def move", "def moves", ": has no hook: moves; write one of arrive, aim, "),
        ("    @staticmethod\n", "", ": is no static method: hook move; write @staticmethod above it"),
        ("@dataclass(frozen=True)\n", "", ": is no dataclass: LateralLoadLoss; write @dataclass(frozen=True) above"),
        ('parameter(unit="s²/m", low=0.0, high=5.0, scale=0.5)', "0.1", ": a field is no parameter: loss; write loss"),
        ("LEFT, YAW_RATE", "LEFT, YAW_RAT", ":8: cannot be imported: ImportError cannot import name 'YAW_RAT' from "),
        ("state[LEFT] *= kept", "state[LEFT *= kept", ":33: cannot be imported: "),
    ],
)  # fmt: skip
def test_an_incomplete_file_is_named(own, tmp_path, old, new, message):
    write(tmp_path, old, new)
    with pytest.raises(FileError) as caught:
        own()
    assert str(caught.value).startswith(f"effects/lateral_load_loss.py{message}")


def test_a_correct_file_passes(own, tmp_path):
    write(tmp_path)
    assert list(own()) == ["lateral_load_loss"]
    check_hooks(own().values())


@pytest.mark.slow
def test_the_simulation_and_the_list_name_the_hook(tmp_path):
    write(tmp_path, "kept = 1.0", "keptt = 1.0")
    listed = python(tmp_path, "-m", "agvbench", "effects")
    line = "effects/lateral_load_loss.py:32: hook move: name 'kept' is not defined; did you mean keptt? else define "
    assert listed.returncode == 2
    assert listed.stderr.splitlines()[-1].startswith(f"agvbench effects: {line}")
    simulated = python(tmp_path, "-c", PROGRAM)
    assert f"FileError: {line}" in simulated.stderr.splitlines()[-1]
