"""The pages about trajectories: their examples can be planned, and no key is missing from the reference."""

import re
import textwrap
import tomllib
from pathlib import Path

import msgspec
import pytest

from agvbench.planning import Workspace, plan, trajectory_from_table
from agvbench.planning.trajectories import segments as segment_module
from agvbench.planning.trajectories import shapes as shape_module
from agvbench.planning.trajectories.trajectory import SHAPES, Trajectory

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [DOCS / "reference" / "trajectories.md", DOCS / "how-to" / "write-a-trajectory.md"]
FENCE = re.compile(r"^ *```toml\n(.*?)^ *```", re.DOTALL | re.MULTILINE)
EXAMPLES = [textwrap.dedent(text) for page in PAGES for text in FENCE.findall(page.read_text(encoding="utf-8"))]
STRUCTS = [
    thing
    for module in (segment_module, shape_module)
    for thing in vars(module).values()
    if isinstance(thing, type) and issubclass(thing, msgspec.Struct) and thing is not msgspec.Struct
]


@pytest.mark.parametrize("text", EXAMPLES, ids=[tomllib.loads(text)["name"] for text in EXAMPLES])
def test_an_example_can_be_planned(text, calibrated):
    made = plan(trajectory_from_table(tomllib.loads(text)), calibrated, workspace=Workspace.circle())
    assert made.duration_s > 1.0


@pytest.mark.parametrize("struct", [Trajectory, *dict.fromkeys(STRUCTS)], ids=lambda struct: struct.__name__)
def test_the_reference_names_every_key(struct):
    reference = PAGES[0].read_text(encoding="utf-8")
    for field in msgspec.structs.fields(struct):
        assert (
            f"`{field.encode_name}`" in reference
            or f"`{field.encode_name} = " in reference
            or (field.encode_name in ("x_m", "y_m", "heading_deg") and f"{field.encode_name} = …" in reference)
        )


def test_the_reference_has_a_section_for_every_shape():
    reference = PAGES[0].read_text(encoding="utf-8")
    assert all(f"\n## {shape}\n" in reference for shape in SHAPES)
