"""Every decoder, on what a coverage-guided fuzzer found worth keeping, and on what is drawn here.

Only the project's own errors may come out, each of them one line (`fuzz.target.Target.check`).
"""

from __future__ import annotations

from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agvbench.errors import AgvbenchError
from fuzz.target import Target, targets

NAMES = sorted(targets())
every_target = pytest.mark.parametrize("name", NAMES)


@cache
def target(name: str) -> Target:
    if missing := targets()[name].missing():
        pytest.skip(missing)
    return targets()[name]()


@cache
def seeds(name: str) -> list[bytes]:
    return list(target(name).seeds())


@every_target
def test_what_is_right_is_decoded(name: str) -> None:
    refused = 0
    for seed in seeds(name):
        try:
            target(name).feed(seed)
        except AgvbenchError:
            refused += 1
    assert refused < len(seeds(name)), "what is right is among the seeds"


@every_target
def test_what_was_found_before_does_no_harm(name: str) -> None:
    kept = target(name).corpus()
    assert kept
    for path in kept:
        target(name).check(path.read_bytes())


@every_target
@settings(max_examples=30)
@given(data=st.data())
def test_what_is_drawn_does_no_harm(name: str, data: st.DataObject) -> None:
    """Nonsense, and what is right with a piece cut out, doubled or changed."""
    base = data.draw(st.sampled_from([b"", *seeds(name)]))
    start = data.draw(st.integers(0, len(base)))
    end = data.draw(st.integers(start, min(len(base), start + 64)))
    piece = data.draw(st.one_of(st.binary(max_size=64), st.just(base[start:end] * 2)))
    target(name).check(base[:start] + piece + base[end:])
