"""What the rules of `tests/conftest.py` do with failures: in a pytest of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

TESTS = """
    import pathlib, time
    import pytest
    from hypothesis import given, strategies

    def fails_once(name):
        seen = pathlib.Path(name)
        if not seen.exists():
            seen.touch()
            raise AssertionError("only once")

    @pytest.mark.real_time
    def test_late():
        fails_once("late")

    def test_wrong():
        fails_once("wrong")

    @pytest.mark.real_time
    @pytest.mark.timeout(1)
    def test_hangs():
        time.sleep(60.0)

    @given(strategies.floats())
    def test_property(x):
        print("tried", x)
"""


def test_only_real_time_tests_are_repeated_and_every_repeat_is_listed(pytester: pytest.Pytester) -> None:
    pytester.makeconftest((Path(__file__).parents[1] / "conftest.py").read_text(encoding="utf-8"))
    pytester.makeini("[pytest]\nmarkers =\n    real_time: as in pyproject.toml")
    pytester.makepyfile(TESTS)
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "-p", "no:randomly", "-rA")
    result.assert_outcomes(passed=2, failed=2)
    result.stdout.fnmatch_lines(
        ["REPEATED *::test_late after: AssertionError: only once", "*2 failed, 2 passed, 1 rerun*"]
    )
    again = pytester.runpytest_subprocess("-p", "no:cacheprovider", "-p", "no:randomly", "-rA", "-k", "property")
    tried = [[line for line in run.stdout.lines if line.startswith("tried")] for run in (result, again)]
    assert tried[0] == tried[1] != []
