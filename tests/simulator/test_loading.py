"""Finding plants: every mistake a user can make has its one line, and the docs list them."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from agvbench.errors import AgvbenchError
from agvbench.simulator import Camera, CheckedPlant, load_plant, make_plant
from agvbench.types import Plant, Pose

DOCS = Path(__file__).parents[2] / "docs" / "reference" / "errors-plants.md"
RNG = np.random.default_rng(0)

SMALL = "agvbench.simulator:small_plant"
SOURCES = {
    "my_plant.py": """
        import math
        from collections import namedtuple

        number = 5

        class Base:
            def __init__(self, seed):
                pass
            def reset(self, pose, *, seed):
                self.pose = pose
            def advance(self, drive, front, rear, dt):
                return self.pose

        class Divides(Base):
            def advance(self, drive, front, rear, dt):
                return 1 / 0, 0.0, 0.0

        class NoSeed(Base):
            def reset(self, pose):
                self.pose = pose

        class Pair(Base):
            def advance(self, *command):
                return 1.0, 2.0

        class Text(Base):
            def advance(self, *command):
                return "here"

        class Nan(Base):
            def advance(self, *command):
                return math.nan, 0.0, 0.0

        class Nothing(Base):
            def advance(self, *command):
                pass

        class OnlyReset:
            def __init__(self, seed):
                pass
            def reset(self, pose, *, seed):
                pass

        class BadState(Base):
            def true_state(self):
                return 3.0

        def broken(seed):
            raise RuntimeError("no licence")

        def forgot(seed):
            Base(seed)

        def the_class(seed):
            return Base

        class NeedsMass(Base):
            def __init__(self, seed, *, mass_kg):
                pass
        """,
    "syntax.py": "def make_plant(seed:\n",
    "needs.py": "import a_library_that_is_not_there\n",
    "stops.py": "raise SystemExit('bye')\n",
    "plant.txt": "",
}


def use(name):
    plant = load_plant(f"my_plant.py:{name}")(0)
    plant.reset((0.0, 0.0, 0.0), seed=1)
    return plant.advance(1500.0, 1500.0, 1500.0, 0.1)


CASES = {
    "no factory named": lambda: load_plant("my_plant.py"),
    "no such file": lambda: load_plant("plants/mine.py:make_plant"),
    "file is not Python": lambda: load_plant("./plant.txt:make_plant"),
    "no such module": lambda: load_plant("my_lab.plants:make_plant"),
    "not a module name": lambda: load_plant("my-lab:make_plant"),
    "syntax error": lambda: load_plant("syntax.py:make_plant"),
    "import fails": lambda: load_plant("needs.py:make_plant"),
    "file stops the program": lambda: load_plant("stops.py:make_plant"),
    "no such factory": lambda: load_plant("my_plant.py:brokem"),
    "factory cannot be called": lambda: load_plant("my_plant.py:number"),
    "factory raises": lambda: load_plant("my_plant.py:broken")(0),
    "factory returns nothing": lambda: load_plant("my_plant.py:forgot")(0),
    "factory returns a class": lambda: load_plant("my_plant.py:the_class")(0),
    "plant lacks a method": lambda: load_plant("my_plant.py:OnlyReset")(0),
    "reset takes no seed": lambda: use("NoSeed"),
    "advance raises": lambda: use("Divides"),
    "advance returns nothing": lambda: use("Nothing"),
    "advance returns two numbers": lambda: use("Pair"),
    "advance returns text": lambda: use("Text"),
    "advance returns NaN": lambda: use("Nan"),
    "true_state is no mapping": lambda: load_plant("my_plant.py:BadState")(0).true_state(),
    "command is NaN": lambda: make_plant(0).advance(math.nan, 1500.0, 1500.0, 0.1),
    "command is no number": lambda: make_plant(0).advance(None, 1500.0, 1500.0, 0.1),
    "time runs backward": lambda: make_plant(0).advance(1500.0, 1500.0, 1500.0, -0.1),
    "start pose is NaN": lambda: make_plant(0).reset((0.0, math.nan, 0.0), seed=1),
    "camera without rate": lambda: Camera(rate_hz=0.0),
    "camera loses too much": lambda: Camera(lost=1.0),
    "camera noise is negative": lambda: Camera(marker_noise_m=-0.001),
    "camera noise does not fit": lambda: Camera(marker_noise_m=(0.001, 0.002)),
    "camera with one marker": lambda: Camera(markers=((0.0, 0.0),)),
    "markers in one place": lambda: Camera(markers=((0.1, 0.0), (0.1, 0.0))),
    "unknown camera option": lambda: Camera.from_options({"losst": 0.1}),
    "camera option is no number": lambda: Camera.from_options({"lost": "some"}),
    "unknown plant option": lambda: load_plant(SMALL, {"backlsh_m": "0"}),
    "plant option is no number": lambda: load_plant(SMALL, {"backlash_m": "some"}),
    "plant option is out of range": lambda: load_plant(SMALL, {"backlash_m": "2"})(0),
    "plant needs an option": lambda: load_plant("my_plant.py:NeedsMass"),
    "poses do not fit times": lambda: Camera().observe(np.zeros(3), np.zeros((2, 3)), RNG),
}


@pytest.fixture(autouse=True)
def lab(tmp_path, monkeypatch):
    """A lab folder with plants of all kinds; its files are named relative to it."""
    import textwrap

    for name, text in SOURCES.items():
        (tmp_path / name).write_text(textwrap.dedent(text))
    monkeypatch.chdir(tmp_path)


def documented() -> dict[str, str]:
    rows = re.findall(r"^\| ([^|]+?) \| `(.+)` \|$", DOCS.read_text(), flags=re.MULTILINE)
    return {case: message.replace("\\|", "|") for case, message in rows}


def message_of(case: str) -> str:
    with pytest.raises(AgvbenchError) as caught:
        CASES[case]()
    return str(caught.value)


@pytest.mark.parametrize("case", CASES)
def test_message_is_the_documented_line(case):
    message = message_of(case)
    assert "\n" not in message
    assert message == documented()[case]


def test_the_docs_list_no_other_case():
    assert set(documented()) == set(CASES)


def test_a_file_may_import_its_neighbour_and_hold_dataclasses(tmp_path):
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "neighbour.py").write_text("SPEED = 2.0\n")
    (tmp_path / "lab" / "plant.py").write_text(
        "from __future__ import annotations\nfrom dataclasses import dataclass\nfrom neighbour import SPEED\n"
        "@dataclass\nclass Sled:\n    seed: int\n    x: float = 0.0\n"
        "    def reset(self, pose, *, seed):\n        self.x = pose[0]\n"
        "    def advance(self, drive, front, rear, dt):\n"
        "        self.x += SPEED * dt\n        return [self.x, 0, 0.0]\n"
    )
    plant = load_plant("lab/plant.py:Sled")(seed=1)
    plant.reset((1.0, 0.0, 0.0), seed=2)
    assert plant.advance(0.0, 0.0, 0.0, 0.5) == (2.0, 0.0, 0.0)


def test_a_module_in_the_working_directory_is_found(tmp_path):
    (tmp_path / "lab_module.py").write_text("from agvbench.simulator import make_plant as factory\n")
    assert isinstance(load_plant("lab_module:factory")(0), Plant)


@pytest.mark.parametrize("answer", [Pose(1.0, 2.0, 3.0), [1, 2, 3], np.array([1.0, 2.0, 3.0]), (1, np.float32(2), 3.0)])
def test_three_numbers_of_any_kind_are_a_pose(answer):
    class Answers:
        def reset(self, pose, *, seed):
            pass

        def advance(self, drive, front, rear, dt):
            return answer

    pose = CheckedPlant(Answers(), "answers").advance(0.0, 0.0, 0.0, 0.1)
    assert pose == (1.0, 2.0, 3.0)
    assert all(type(number) is float for number in pose)


@pytest.mark.parametrize("answer", [(1.0, 2.0, 1j), ("1", "2", "3"), (1.0, 2.0, 3.0, 4.0), {}, (math.inf, 0.0, 0.0)])
def test_anything_else_is_not(answer):
    class Answers:
        def reset(self, pose, *, seed):
            pass

        def advance(self, drive, front, rear, dt):
            return answer

    with pytest.raises(AgvbenchError, match=r"^answers: advance returned"):
        CheckedPlant(Answers(), "answers").advance(0.0, 0.0, 0.0, 0.1)


def test_a_checked_plant_answers_as_the_plant_does():
    bare, checked = make_plant(7), load_plant("agvbench.simulator:make_plant")(7)
    for plant in (bare, checked):
        plant.reset((1.0, 2.0, 0.5), seed=3)
    assert bare.advance(900.0, 1400.0, 1600.0, 1.0) == checked.advance(900.0, 1400.0, 1600.0, 1.0)
    assert bare.true_state() == checked.true_state()


def test_interrupts_pass_through():
    class Interrupted:
        def reset(self, pose, *, seed):
            raise KeyboardInterrupt

        def advance(self, drive, front, rear, dt):
            return (0.0, 0.0, 0.0)

    with pytest.raises(KeyboardInterrupt):
        CheckedPlant(Interrupted(), "plant").reset((0.0, 0.0, 0.0), seed=0)
