import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from statistics_samples import TARGETS, make_run

from agvbench.statistics import pose_errors, valid
from agvbench.types import NO_TARGET, Pose

angles = st.floats(-7.0, 7.0)
near = st.floats(-0.2, 0.2)


def table(*runs):
    return pose_errors(runs)


@given(st.floats(-3, 3), st.floats(-3, 3), angles, st.sampled_from(sorted(TARGETS)), near, near, near)
def test_errors_do_not_depend_on_where_on_the_floor_a_run_starts(x, y, heading, name, along, across, turn):
    target = Pose(*TARGETS[name])
    c, s = math.cos(heading), math.sin(heading)
    reached = target.x_m + along, target.y_m + across
    end = (
        x + c * reached[0] - s * reached[1],
        y + s * reached[0] + c * reached[1],
        heading + target.heading_rad + turn,
    )
    row = table(make_run((x, y, heading), end, target=target)).iloc[0]
    assert row.problem == ""
    assert row.along_mm == pytest.approx(1e3 * along, abs=1e-6)
    assert row.across_mm == pytest.approx(1e3 * across, abs=1e-6)
    assert row.position_mm == pytest.approx(1e3 * math.hypot(along, across), abs=1e-6)
    assert row.delta_heading_deg == pytest.approx(math.degrees(turn), abs=1e-6)
    assert row.delta_s_mm == pytest.approx(1e3 * (math.hypot(*reached) - math.hypot(*target[:2])), abs=1e-6)
    assert (row.end_x_m, row.end_y_m) == pytest.approx(reached, abs=1e-9)


def test_signs_and_the_rotation_of_a_right_turn():
    # A right turn of 98° instead of 90° that ends 0.1 m too far out.
    run = make_run((0, 0, 0), (1.1, -1.1, math.radians(-98)), target=Pose(1, -1, -math.pi / 2))
    row = table(run).iloc[0]
    assert row.delta_heading_deg == pytest.approx(-8.0)
    assert row.rotation_deg == pytest.approx(98.0)
    assert row.delta_s_mm == pytest.approx(100 * math.sqrt(2))
    assert (row.along_mm, row.across_mm) == pytest.approx((100.0, -100.0))


def test_standard_errors_cover_the_scatter_of_the_camera():
    errors = table(*(make_run((0, 0, 0), (2, 0, 0), noise_m=1e-3, seed=seed, run_id=str(seed)) for seed in range(150)))
    assert np.std(errors.delta_s_mm) == pytest.approx(errors.stderr_position_mm.mean(), rel=0.2)
    assert np.std(errors.delta_heading_deg) == pytest.approx(errors.stderr_heading_deg.mean(), rel=0.2)


def test_runs_without_target_have_no_row_and_rejected_runs_do_not_count():
    good, free = make_run((0, 0, 0), (2, 0, 0)), make_run((0, 0, 0), (1, 0, 0), target=NO_TARGET)
    rejected = make_run((0, 0, 0), (2, 0, 0), run_id="r2", status="rejected: gap")
    blind = make_run((0, 0, 0), (2, 0, 0), run_id="r3")
    blind.frames.tracked[:] = False
    errors = table(good, free, rejected, blind)
    assert list(errors.run_id) == ["r1", "r2", "r3"]
    assert errors.problem[2] == "no tracked frame at rest before the first command"
    assert list(valid(errors).run_id) == ["r1"]


def test_no_runs_give_an_empty_table_with_its_columns():
    errors = table()
    assert errors.empty
    assert {"position_mm", "delta_s_mm", "delta_heading_deg", "along_mm", "across_mm"} <= set(errors.columns)
