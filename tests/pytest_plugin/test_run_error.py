"""Benchmarks as tests: ``assert run.error.position_mm < 10``."""

from __future__ import annotations

from agvbench import Campaign, pose_errors

pytest_plugins = ["pytester"]

BENCHMARK = """
    '''Benchmarks of agvbench.'''

    def bench_accepted(drive):
        run = drive.trajectory("1", condition="uncalibrated")
        assert run.error.position_mm < 2000.0
        assert abs(run.error.heading_deg) < 180.0

    def bench_refused(drive):
        run = drive.trajectory("1", condition="uncalibrated")
        assert run.error.position_mm < 0.001

    def bench_without_target(drive):
        run = drive.hold(drive=1.0, for_s=1.0)
        assert run.error.delta_s_mm < 10.0
"""


def test_the_error_of_a_run_can_be_asserted_and_says_what_was_compared(pytester):
    pytester.makepyfile(bench_mine=BENCHMARK)
    out = pytester.path / "campaign"
    # The file is not named: pytest rewrites the asserts of files that are.
    options = ("-p", "no:cacheprovider", "--agvbench-no-report", f"--agvbench-out={out}")
    result = pytester.runpytest_subprocess(*options)

    result.assert_outcomes(passed=1, failed=2)
    result.stdout.fnmatch_lines(
        [
            "E   *assert * < 0.001",
            "E   * where * = RunError(position_mm=*, along_mm=*, delta_heading_deg=*).position_mm",
            "E   * where RunError(*) = <run refused>.error",
            "*bench_without_target: without-target: the run has no target, so no error; drive a trajectory that has*",
        ]
    )
    campaign = Campaign.open(out)
    assert campaign.runs["status"].tolist() == ["ok", "ok", "ok"], "an assert judges a run, it does not reject it"
    refused = pose_errors([campaign.run("refused")]).iloc[0]
    assert f"position_mm={refused['position_mm']:.2f}" in result.stdout.str()
