"""Runs that a controller drives: better than the open-loop plan, recorded, resumed and stopped as other runs are."""

from __future__ import annotations

import math
import time
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from agvbench.campaign import Campaign
from agvbench.campaign.names import planned_name
from agvbench.control import Motion, PurePursuit, Reference, Stanley
from agvbench.errors import ControllerError, FlagError, PlanError
from agvbench.model import example_path
from agvbench.model.examples import example_vehicle
from agvbench.planning import load_trajectory, plan
from agvbench.running.execution.closed_loop import ClosedLoop, Control
from agvbench.running.session.driver import NotDrivenError, RunRejectedError
from agvbench.running.session.opening import open_session
from agvbench.types import Command, Frames, Pose

CALIBRATED = {"calibration": str(example_path("thesis")), "seed": 3}
TABLES = ("runs", "commands", "poses")


def opened(out, *, resume=False, dry_run=False, **given):
    options = {} if resume else CALIBRATED | given
    return open_session(options, out=str(out), resume=resume, dry_run=dry_run, on_progress=lambda _: None)


def controlled(session, make, name="5", *, run_id="closed", condition="calibrated", **more):
    return session.driver(run_id, experiment="closed", repeat=1).controlled(name, make, condition=condition, **more)


def parts(campaign, run_id):
    return [(campaign / f"{table}.parquet" / f"{run_id}.parquet").read_bytes() for table in TABLES]


def statuses(campaign):
    return {run.run_id: run.status for run in Campaign.open(campaign)}


@pytest.mark.parametrize("condition", ["uncalibrated", "calibrated"])
def test_a_controller_ends_much_nearer_to_the_target_than_the_plan(condition, tmp_path):
    with opened(tmp_path / "c") as session:
        open_loop = session.driver("open", experiment="open", repeat=1).trajectory("figure_eight", condition=condition)
        for make in (PurePursuit, Stanley):
            run = controlled(session, make, "figure_eight", run_id=make.__name__, condition=condition)
            assert run.error.position_mm < open_loop.error.position_mm / 5


def test_controllers_that_differ_in_parameters_have_names_of_their_own(tmp_path):
    with opened(tmp_path / "c") as session:
        controlled(session, partial(PurePursuit, lookahead_m=0.2), controller_name="ahead-0.2")
        with pytest.raises(FlagError, match="controller_name: name cannot be used: a/b"):
            controlled(session, PurePursuit, run_id="other", controller_name="a/b")
    run = Campaign.open(tmp_path / "c").run("closed")
    assert (run.trajectory, run.extra["controller"], planned_name(run)) == ("5-ahead-0.2", "ahead-0.2", "5")


def test_what_was_sent_and_how_late_poses_were_is_recorded(tmp_path):
    with opened(tmp_path / "c") as session:
        controlled(session, partial(PurePursuit, lookahead_m=0.25), period_s=0.05)
    run = Campaign.open(tmp_path / "c").run("closed")
    assert (run.trajectory, run.condition, run.status) == ("5-PurePursuit", "calibrated", "ok")
    assert np.allclose(np.diff(run.commands.t_s), 0.05)
    assert len(set(run.commands.front)) > 20
    assert run.commands.drive[-1] == 1500.0
    assert run.extra["controller"] == "PurePursuit"
    assert run.extra["control_period_s"] == 0.05
    # The newest frame of a camera of 120 Hz is a frame old at most, and its latency.
    assert 0.0 < run.extra["controller_delay_s"] < 1 / 120 + 0.01
    assert "controller_compute_s" not in run.extra


def plan_as_it_is(reference):
    """Return the plan's commands, and nothing of what the camera sees."""
    return lambda seen: seen.planned if seen.t_s < reference.plan.duration_s else None


def feed_forward(reference):
    """Return the plan's motions."""
    return lambda seen: seen.feed_forward if seen.t_s < reference.plan.duration_s else None


def test_the_plan_is_there_as_feed_forward_in_both_forms(tmp_path):
    with opened(tmp_path / "c") as session:
        planned = session.driver("open", experiment="open", repeat=1).trajectory("5", condition="calibrated")
        runs = [controlled(session, make, run_id=make.__name__) for make in (plan_as_it_is, feed_forward)]
    for run in runs:
        row = np.searchsorted(planned.commands.t_s, run.commands.t_s[:-1] + 1e-9, side="right") - 1
        for channel in ("drive", "front", "rear"):
            sent, wanted = getattr(run.commands, channel), getattr(planned.commands, channel)
            assert np.allclose(sent[:-1], wanted[row], atol=1e-6)


def test_a_controller_is_given_time_and_pose_in_the_start_frame(tmp_path):
    given = []

    def noting(reference):
        controller = PurePursuit(reference)
        return lambda seen: (given.append(seen), controller(seen))[1]

    with opened(tmp_path / "c") as session:
        run = controlled(session, noting)
    assert [seen.t_s for seen in given] == pytest.approx([0.1 * k for k in range(len(given))])
    assert math.hypot(*given[0].pose[:2]) < 0.005
    assert all(0.0 < seen.age_s < 0.1 for seen in given)
    last = given[-1].pose.relative_to(run.target)
    assert math.hypot(last.x_m, last.y_m) < 0.1


def test_one_seed_gives_the_same_bytes_however_long_exchanges_are(tmp_path):
    for name, exchange in (("a", 0.1), ("b", 0.1), ("long", 2.0)):
        with opened(tmp_path / name, exchange=exchange) as session:
            controlled(session, Stanley)
    assert parts(tmp_path / "a", "closed") == parts(tmp_path / "b", "closed") == parts(tmp_path / "long", "closed")


def test_a_resumed_session_goes_on_as_if_it_had_not_been_interrupted(tmp_path, give_up):
    campaign = tmp_path / "c"

    def drive(*, resume=False):
        with opened(campaign, resume=resume) as session:
            return [controlled(session, PurePursuit, run_id=f"run-{k}") for k in range(3)]

    drive()
    before = [parts(campaign, f"run-{k}") for k in range(3)]
    give_up(campaign, "run-1")
    give_up(campaign, "run-2")
    drive(resume=True)
    assert [parts(campaign, f"run-{k}") for k in range(3)] == before


class Wrong(Exception):  # noqa: N818
    """What a controller raises."""


def after(n, act):
    """Return a factory of controllers that drive well `n` times, then act."""

    def factory(reference):
        controller, calls = PurePursuit(reference), []

        def called(seen):
            calls.append(seen)
            return controller(seen) if len(calls) <= n else act()

        return called

    return factory


def raising():
    raise Wrong("a sign")


UNUSABLE = (
    r"controller returned what cannot be commanded: {} \(limit: a Motion or a Command of finite numbers, or None\)"
)


@pytest.mark.parametrize(
    ("act", "line"),
    [
        (raising, r"controller failed: Wrong: a sign \(test_closed_loop.py:\d+\)"),
        (lambda: Motion(math.nan), UNUSABLE.format(r"Motion\(speed_mps=nan, curvature_per_m=0.0, crab_rad=0.0\)")),
        (lambda: Command(0.0, math.inf, 0.0), UNUSABLE.format(r"Command\(drive=0.0, front=inf, rear=0.0\)")),
        (lambda: Motion("fast"), UNUSABLE.format(r"Motion\(speed_mps='fast', curvature_per_m=0.0, crab_rad=0.0\)")),
        (lambda: 0.3, UNUSABLE.format("0.3")),
        (lambda: (1500.0, 1500.0, 1500.0), UNUSABLE.format(r"\(1500.0, 1500.0, 1500.0\)")),
    ],
    ids=["raises", "nan", "inf", "text", "number", "tuple"],
)
def test_a_controller_that_fails_stops_the_vehicle_and_its_run_is_kept(act, line, tmp_path):
    with opened(tmp_path / "c") as session:
        with pytest.raises(ControllerError, match=f"^closed: factory: {line}$"):
            controlled(session, after(25, act))
        assert session.failure is None
        assert controlled(session, PurePursuit, run_id="next").error.position_mm < 40
    run = Campaign.open(tmp_path / "c").run("closed-aborted1")
    assert run.status.startswith("aborted: closed: factory: controller ")
    assert np.allclose(run.commands.t_s, 0.1 * np.arange(25))
    assert run.frames.t_s.max() > 2.3
    assert run.extra["controller"] == "factory"
    assert Campaign.open(tmp_path / "c").run("next").started_s > run.started_s


def test_a_first_call_that_fails_moves_nothing(tmp_path):
    with opened(tmp_path / "c") as session, pytest.raises(ControllerError, match="controller failed: Wrong"):
        controlled(session, after(0, raising))
    run = Campaign.open(tmp_path / "c").run("closed-aborted1")
    assert run.frames.t_s.max() < 0.0


def test_a_controller_that_never_ends_is_rejected_after_the_vehicle_stopped(tmp_path):
    def endless(_):
        return lambda seen: Motion(0.05 if seen.t_s < 1.0 else 0.0)

    with opened(tmp_path / "c", attempts=2) as session, pytest.raises(RunRejectedError, match="did not end the run"):
        controlled(session, endless)
    said = statuses(tmp_path / "c")
    assert list(said) == ["closed", "closed-attempt2"]
    assert set(said.values()) == {"rejected: the controller endless did not end the run (limit: 15.8 s)"}
    run = Campaign.open(tmp_path / "c").run("closed")
    assert run.commands.t_s[-1] == pytest.approx(15.8, abs=0.1)
    assert run.frames.t_s.max() > run.commands.t_s[-1] + 1.0


def test_what_is_out_of_range_is_clipped(tmp_path):
    with opened(tmp_path / "c") as session:
        run = controlled(session, lambda _: lambda seen: Motion(1e9, -1e9) if seen.t_s < 1.0 else None)
    model = session.model("calibrated")
    assert run.commands.drive[0] == pytest.approx(float(model.drive.inverse(model.drive.output_range[1])))
    assert float(model.front(run.commands.front[0])) == pytest.approx(model.front.output_range[0])


def test_the_supervisor_stops_a_controlled_vehicle_as_any_other(tmp_path):
    def away(_):
        return lambda seen: Motion(0.3)

    with opened(tmp_path / "c", attempts=1) as session, pytest.raises(RunRejectedError, match="leaving the capture"):
        controlled(session, away, "1")
    run = Campaign.open(tmp_path / "c").run("closed")
    assert run.extra["controller_delay_s"] > 0.0
    assert len(run.commands) > 20


def test_a_controlled_vehicle_that_is_not_tracked_is_stopped(tmp_path):
    given = {"attempts": 1, "camera": "untracked=0.01,burst_frames=10000"}
    with opened(tmp_path / "c", **given) as session, pytest.raises(RunRejectedError, match="tracking was lost"):
        controlled(session, PurePursuit, "figure_eight")


def test_an_interrupted_run_keeps_what_was_driven(tmp_path):
    def interrupting():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), opened(tmp_path / "c") as session:
        controlled(session, after(15, interrupting))
    assert statuses(tmp_path / "c") == {"closed-aborted1": "aborted: interrupted"}
    with opened(tmp_path / "c", resume=True) as session:
        assert controlled(session, PurePursuit).is_ok


@pytest.mark.parametrize("dry_run", [True, False])
def test_what_a_controller_cannot_follow_is_said_before_anything_moves(dry_run, tmp_path):
    with opened(tmp_path / "c", dry_run=dry_run) as session:
        with pytest.raises(PlanError, match="crab: a path across the heading cannot be followed"):
            controlled(session, PurePursuit, "crab")
        assert session.not_applicable == {"closed"}
        with pytest.raises(ControllerError, match="closed: wrong_factory: controller failed: Wrong: a sign"):
            controlled(session, wrong_factory)
        with pytest.raises(FlagError, match=r"period_s: control cycle cannot be used: 2 s \(limit: 0.02 to 0.5 s\)"):
            controlled(session, PurePursuit, period_s=2.0)
    assert not (tmp_path / "c" / "runs.parquet").exists() or not list((tmp_path / "c" / "runs.parquet").iterdir())


def wrong_factory(_):
    raising()


def test_a_dry_run_plans_the_run(tmp_path):
    with opened(tmp_path / "c", dry_run=True) as session:
        with pytest.raises(NotDrivenError, match="dry run"):
            controlled(session, Stanley)
        ((request, _),) = session.planned
    assert request.trajectory == "5-Stanley"


@pytest.mark.parametrize("make", [PurePursuit, Stanley])
def test_a_differential_vehicle_is_controlled_as_one_of_two_axles(make, tmp_path):
    vehicle = str(example_path("differential"))
    given = {"vehicle": vehicle, "calibration": vehicle}
    with opened(tmp_path / "c", **given) as session:
        open_loop = session.driver("open", experiment="open", repeat=1).trajectory(
            "figure_eight", condition="calibrated"
        )
        run = controlled(session, make, "figure_eight")
    assert run.error.position_mm < max(40.0, open_loop.error.position_mm / 3)


@pytest.mark.real_time
def test_in_real_time_the_delay_of_a_controller_is_measured_and_its_commands_are_as_late(tmp_path):
    with opened(tmp_path / "c", agv="live") as session:
        run = controlled(session, partial(slow, by_s=0.03))
    assert run.error.position_mm < 100
    assert run.extra["controller_compute_s"] >= 0.03
    assert run.extra["controller_delay_s"] >= 0.03
    assert run.commands.t_s[0] == 0.0
    assert np.all(run.commands.t_s[1:] >= 0.1 * np.arange(1, len(run.commands)) + 0.03 - 1e-9)


def slow(reference, by_s):
    """Return a pure pursuit that takes `by_s` [s] each time."""
    controller = PurePursuit(reference)
    return lambda seen: (time.sleep(by_s), controller(seen))[1]


@pytest.mark.parametrize("first_s", [0.0, 0.15])
def test_a_vehicle_stands_while_a_controller_prepares_its_first_answer(first_s):
    """The run's clock continues: what is sent late is stated as late."""

    class Slow:
        calls = 0

        def __call__(self, given):
            self.calls += 1
            time.sleep(first_s if self.calls == 1 else 0.0)
            return Motion(0.2, 0.0) if given.t_s < 0.4 else None

    model = example_vehicle("thesis")
    control = Control(lambda *_: Slow(), Reference(plan(load_trajectory("1"), model), model), 0.1)
    sent = list(ClosedLoop(control, "r", Pose(0.0, 0.0, 0.0), lock_step=False)([Frames.empty()]))
    first, second = sent[:2]
    assert first.t_s == 0.0
    if first_s:
        assert first.command.drive == model.neutral.drive
        assert second.t_s >= first_s
    assert all(later.t_s >= earlier.t_s + earlier.hold_s - 1e-9 for earlier, later in pairwise(sent))
