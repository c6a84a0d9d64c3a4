"""The plugin in a pytest of its own: what is collected, in which order, and what stays untouched."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from agvbench.model import example_path
from agvbench.pytest_plugin.collection import _check_length

pytest_plugins = ["pytester"]


@pytest.fixture(autouse=True)
def _without_hypothesis(monkeypatch):
    """Without the plugin of Hypothesis, which takes a third of the time of each pytest here."""
    monkeypatch.setenv("PYTEST_ADDOPTS", "-p no:hypothesispytest")


BENCHMARK = """
    '''Benchmarks of agvbench.'''
    import pytest

    @pytest.mark.repeats(2, full=3)
    @pytest.mark.grid("share", [0.5], [0.25, 0.5])
    def bench_steering_front(drive, share):
        drive.hold(drive=1.0, front=share, for_s=1.0)

    @pytest.mark.repeats
    @pytest.mark.experiment("trajectory")
    @pytest.mark.parametrize("condition", ["uncalibrated", "calibrated"])
    @pytest.mark.parametrize("trajectory", ["3", "5"])
    def bench_trajectory(drive, trajectory, condition):
        drive.trajectory(trajectory, condition=condition)

    def test_not_a_benchmark():
        raise AssertionError
"""


@pytest.fixture
def bench_file(pytester):
    return pytester.makepyfile(bench_mine=BENCHMARK)


def collected(pytester, *options):
    # In a process of its own: the bench options must not leak into this session.
    result = pytester.runpytest_subprocess("--collect-only", "-q", "-p", "no:cacheprovider", *options)
    assert result.ret == 0, result.stdout.str() + result.stderr.str()
    return [line.partition("::bench_")[2] for line in result.stdout.lines if "::bench_" in line]


@pytest.mark.usefixtures("bench_file")
def test_only_the_conditions_that_are_asked_for_are_driven(pytester):
    assert collected(pytester, "--agvbench-repeats=1", "--agvbench-conditions=calibrated") == [
        "steering_front[0.5-r01]",
        "steering_front[0.5-r02]",
        "trajectory[3-calibrated-r01]",
        "trajectory[5-calibrated-r01]",
    ]


@pytest.mark.usefixtures("bench_file")
@pytest.mark.parametrize(
    ("conditions", "more", "said"),
    [
        ("fast", (), "fast (one of: calibrated, uncalibrated); correct it"),
        ("calibrated", ("-k", "steering"), "calibrated; correct it"),
    ],
)
def test_a_condition_that_nothing_has_is_refused(pytester, conditions, more, said):
    result = pytester.runpytest_subprocess(f"--agvbench-conditions={conditions}", *more)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"*--agvbench-conditions: no run to drive is under this condition: {said}*"])


@pytest.mark.usefixtures("bench_file")
def test_calibration_first_repeats_interleaved_and_no_uncalibrated_half_speed(pytester):
    assert collected(pytester, "--agvbench-repeats=2") == [
        "steering_front[0.5-r01]",
        "steering_front[0.5-r02]",
        "trajectory[3-calibrated-r01]",
        "trajectory[5-uncalibrated-r01]",
        "trajectory[5-calibrated-r01]",
        "trajectory[3-calibrated-r02]",
        "trajectory[5-uncalibrated-r02]",
        "trajectory[5-calibrated-r02]",
    ]


SHIPPED = """
    '''Benchmarks of agvbench.'''
    import pytest

    @pytest.mark.repeats
    @pytest.mark.trajectories
    @pytest.mark.parametrize("condition", ["uncalibrated", "calibrated"])
    def bench_trajectory(drive, trajectory, condition):
        drive.trajectory(trajectory, condition=condition)
"""
PALLET = 'schema = 1\nname = "pallet"\n\n[[segments]]\nkind = "straight"\nlength_m = 1.0\n'


def test_the_trajectories_driven_are_those_named_in_that_order(pytester):
    pytester.makepyfile(bench_mine=SHIPPED)
    assert collected(pytester, "--agvbench-repeats=1", "--agvbench-trajectories=garage,3") == [
        "trajectory[garage-uncalibrated-r01]",
        "trajectory[garage-calibrated-r01]",
        "trajectory[3-calibrated-r01]",
    ]


def test_the_eight_and_the_folders_own_are_driven_by_default(pytester):
    pytester.makepyfile(bench_mine=SHIPPED)
    pytester.mkdir("trajectories").joinpath("pallet.toml").write_text(PALLET)
    names = [name for name in collected(pytester, "--agvbench-repeats=1") if "-calibrated" in name]
    assert names == [f"trajectory[{name}-calibrated-r01]" for name in (*"12345678", "pallet")]


@pytest.mark.usefixtures("bench_file")
def test_trajectories_that_no_benchmark_takes_are_refused(pytester):
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "--agvbench-trajectories=garage")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert "--agvbench-trajectories: none of these benchmarks takes it" in result.stderr.str() + result.stdout.str()


@pytest.mark.usefixtures("bench_file")
def test_full_takes_the_whole_grid_and_every_repeat(pytester):
    names = collected(pytester, "--agvbench-full", "--agvbench-repeats=1", "--agvbench-order=blocked")
    assert names[:6] == [f"steering_front[{share}-r0{k}]" for share in (0.25, 0.5) for k in (1, 2, 3)]


@pytest.mark.usefixtures("bench_file")
def test_ten_repeats_by_default(pytester):
    assert sum("trajectory[5-calibrated" in name for name in collected(pytester)) == 10


def test_bench_files_of_other_tools_stay_theirs(pytester):
    pytester.makepyfile(bench_other="def bench_a():\n    raise AssertionError\n")
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--agvbench-repeats=-1"], "--agvbench-repeats: value cannot be used: -1 (limit: 1 to 1000)"),
        (["--agvbench-order=random"], "argument --agvbench-order: invalid choice: 'random'"),
        (["--agvbench-seed=-4"], "--agvbench-seed: value cannot be used: -4"),
        (["--agvbench-attempts=0"], "--agvbench-attempts: value cannot be used: 0"),
        (["--agvbench-resume", "--agvbench-out=no"], "--agvbench-resume --agvbench-out: no session to resume: no"),
    ],
)
@pytest.mark.usefixtures("bench_file")
def test_options_that_cannot_be_used_are_told_in_one_line(pytester, options, line):
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", *options)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert line in result.stderr.str() + result.stdout.str()
    assert "Traceback" not in result.stderr.str()


@pytest.mark.usefixtures("bench_file")
def test_parallel_workers_are_refused_since_there_is_one_vehicle(pytester):
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "-n1", "-k", "steering", "--agvbench-repeats=1")
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(["*one vehicle drives one run at a time: leave -n out*"])


def test_a_failure_that_ends_the_session_is_said_first_and_last_with_the_name_of_its_run(pytester):
    pytester.makepyfile(
        bench_four="""
        '''For agvbench.'''
        import pytest

        @pytest.mark.repeats(4)
        def bench_straight(drive):
            drive.hold(drive=1.0, for_s=0.3)
        """
    )
    result = pytester.runpytest_subprocess(
        "-q", "-p", "no:cacheprovider", "--agvbench-agv=impaired:fails@2/0:sim", "--agvbench-no-report"
    )
    said = "ERROR: the bench was stopped in run straight-r02: agv adapter: the agv adapter failed: RuntimeError"
    lines = [line for line in result.outlines if line and "elapsed" not in line]
    assert lines[0].startswith(said)
    assert lines[1] == "2 runs after it were not driven"
    assert lines[-1].startswith("1 passed, 1 stopped")
    assert result.errlines[-1].startswith(said)
    assert result.stdout.str().count("RuntimeError") == 1
    assert result.ret == 2


@pytest.mark.parametrize(
    ("source", "line"),
    [
        (
            "@pytest.mark.repeats(0)\ndef bench_a(drive): pass",
            "repeats: value cannot be used: 0 (limit: a whole",
        ),
        ("def bench_a(drive): raise SystemExit(3)", "bench_a: a benchmark called sys.exit: 3; return, or raise"),
    ],
)
def test_a_benchmark_that_cannot_be_driven_is_one_line(pytester, source, line):
    pytester.makepyfile(bench_it=f"'For agvbench.'\nimport pytest\n\n{source}\n")
    result = pytester.runpytest_subprocess("-q", "-p", "no:cacheprovider", "--agvbench-no-report")
    assert result.ret == 2
    assert any(said.startswith(line) for said in result.outlines), result.outlines
    assert "Traceback" not in result.stdout.str() + result.stderr.str()


@pytest.mark.parametrize("named", [[], ["bench_it.py"]], ids=["found", "named"])
def test_a_file_that_calls_sys_exit_is_one_line(pytester, named):
    pytester.makepyfile(bench_it="# agvbench\nraise SystemExit(3)\n")
    result = pytester.runpytest_subprocess("-q", "-p", "no:cacheprovider", "--agvbench-no-report", *named)
    assert result.ret == 2
    text = result.stdout.str() + result.stderr.str()
    # On a CI server pytest's summary repeats the whole line of the error; elsewhere it cuts it.
    before_summary = text.split("short test summary info")[0]
    assert before_summary.count("bench_it.py: calls sys.exit when it is imported: 3; ") == 1
    assert "Traceback" not in text
    assert "INTERNALERROR" not in text


def test_runs_that_the_vehicle_cannot_drive_are_not_counted(pytester):
    pytester.makepyfile(
        bench_axles="""
        '''For agvbench.'''
        import pytest

        @pytest.mark.repeats(5)
        def bench_rear(drive):
            drive.hold(drive=1.0, rear=0.5, for_s=0.3)

        @pytest.mark.repeats(5)
        def bench_straight(drive):
            drive.hold(drive=1.0, for_s=0.3)
        """
    )
    vehicle = f"--agvbench-vehicle={example_path('front_steered')}"
    result = pytester.runpytest_subprocess("-q", "-p", "no:cacheprovider", "--agvbench-dry-run", vehicle)
    assert [line for line in result.outlines if "/5 runs planned" in line], result.outlines
    assert any(line.split()[:2] == ["total", "5"] for line in result.outlines), result.outlines


@pytest.mark.parametrize("ending", ["attempt2", "aborted1"])
def test_a_benchmark_that_is_named_as_an_attempt_at_another_is_refused(pytester, ending):
    source = f"# agvbench\ndef bench_turn_{ending}(drive):\n    drive.hold(drive=1.0, for_s=1.0)\n"
    pytester.makepyfile(bench_it=source)
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "--agvbench-dry-run")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    line = f"the run 'turn-{ending}' would be taken for a further attempt at 'turn'; rename it"
    assert line in result.stderr.str() + result.stdout.str()


def test_two_benchmarks_of_one_run_name_are_refused(pytester):
    source = "# agvbench\ndef bench_a(drive):\n    drive.hold(drive=1.0, for_s=1.0)\n"
    pytester.makepyfile(bench_one=source, bench_two=source)
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert "two benchmarks would record the run 'a'" in result.stderr.str() + result.stdout.str()


SOMEBODY_ELSES_CONFTEST = """
    import pytest

    def pytest_addoption(parser):
        for flag in ("--seed", "--out", "--full", "--repeats", "--resume", "--vehicle", "--order", "--dry-run"):
            parser.addoption(flag, default="theirs")

    def pytest_configure(config):
        config.addinivalue_line("markers", "repeats(n): something else")
        config.addinivalue_line("markers", "experiment(name, date): something else")
        config.addinivalue_line("markers", "grid(size): something else")
"""
SOMEBODY_ELSES_TESTS = """
    import pytest

    @pytest.mark.repeats("often")
    @pytest.mark.experiment(name="LHC", date=2012)
    @pytest.mark.grid(7)
    def test_marks_and_options(request, testrun_uid):
        names = ("seed", "out", "full", "repeats", "resume", "vehicle", "order", "dry_run")
        assert {request.config.getoption(name) for name in names} == {"theirs"}

    def test_speed(benchmark):
        assert benchmark(sum, [1, 2]) == 3

    def test_no_fixture_of_ours(drive):
        pass
"""


@pytest.mark.parametrize("plugins", [("-n1",), ("-n0", "-p", "randomly", "--randomly-seed=3")])
def test_a_project_with_options_marks_and_plugins_of_its_own_is_left_alone(pytester, plugins):
    pytester.makeconftest(SOMEBODY_ELSES_CONFTEST)
    pytester.makepyfile(test_theirs=SOMEBODY_ELSES_TESTS)
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "--strict-markers", *plugins)
    result.assert_outcomes(passed=2, errors=1)
    result.stdout.fnmatch_lines(["*fixture 'drive' not found*"])


def test_every_option_of_the_plugin_carries_its_name(pytester):
    result = pytester.runpytest_subprocess("--help")
    ours = result.stdout.str().partition("AGV bench:")[2].partition("\n\n")[0]
    flags = [line.split()[0] for line in ours.splitlines() if line.lstrip().startswith("--")]
    assert "--agvbench-seed=N" in flags
    assert all(flag.startswith("--agvbench-") for flag in flags)
    assert "repeats(n" not in pytester.runpytest_subprocess("--markers").stdout.str()


def test_a_run_whose_parts_no_file_can_be_named_after_is_refused():
    item = SimpleNamespace(nodeid="bench_x.py::bench_x[...]")
    _check_length(item, "x" * 170)
    with pytest.raises(pytest.UsageError, match="has too long a name: 190 characters"):
        _check_length(item, "x" * 190)
