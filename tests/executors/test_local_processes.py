"""Tasks on processes of this machine: bounded, retried, and never ended by one that fails."""

from __future__ import annotations

import os
import signal
import threading
import time
from itertools import count

import executed
import pytest

from agvbench.errors import FlagError
from agvbench.executors import Done, ExecutorOptions, Failed, Task, check_address, open_executor


def run(function, arguments, kind=int, jobs=2):
    tasks = [Task(n, function, one) for n, one in enumerate(arguments)]
    with open_executor(ExecutorOptions(jobs=jobs)) as executor:
        return {outcome.key: outcome for outcome in executor.run(tasks, kind)}


def test_outcomes_come_with_their_keys_whatever_their_order():
    found = run(executed.square, [(float(n),) for n in range(5)], float)
    assert found == {n: Done(n, float(n * n)) for n in range(5)}


def test_a_failure_is_an_outcome_with_its_cause_and_ends_nothing():
    found = run(executed.fails, [(n,) for n in range(5)])
    assert [found[n].result for n in (0, 1, 4)] == [0, 1, 4]
    assert found[2] == Failed(2, "number 2: nothing to fit")
    assert found[3].was_raised
    assert found[3].cause.startswith("KeyError: 'number' (executed.py, line ")


def test_a_result_of_another_type_is_a_failure():
    assert "is no int" in run(executed.text, [(1,)])[0].cause


def test_a_function_that_a_process_cannot_import_is_a_failure_with_its_cause(tmp_path, monkeypatch):
    (tmp_path / "passing.py").write_text("def passes(n): return n")
    monkeypatch.syspath_prepend(tmp_path)
    from passing import passes

    (tmp_path / "passing.py").unlink()
    found = run(passes, [(1,), (2,)], jobs=1)
    assert [found[n].cause.partition(" (")[0] for n in (0, 1)] == ["ModuleNotFoundError: No module named 'passing'"] * 2


def test_a_process_that_dies_is_replaced_and_its_task_run_again(tmp_path):
    found = run(executed.dies, [(str(tmp_path), n, n) for n in range(3)])
    assert found == {n: Done(n, n + 1) for n in range(3)}


def test_a_task_whose_process_always_dies_is_a_failure_after_three_retries(tmp_path):
    found = run(executed.dies, [(str(tmp_path), 0, 9), (str(tmp_path), 1, 0)])
    assert found == {0: Failed(0, "process was killed by SIGKILL, 4 times"), 1: Done(1, 1)}
    assert len(list(tmp_path.glob("0-*"))) == 4


def test_tasks_without_end_are_begun_as_others_end(tmp_path):
    endless = (Task(n, executed.logged, (str(tmp_path), n)) for n in count())
    with open_executor(ExecutorOptions(jobs=2)) as executor:
        outcomes = executor.run(endless, int)
        ended = [next(outcomes).key for _ in range(4)]
        assert len({int(path.name.split("-")[0]) for path in tmp_path.iterdir()} - set(ended)) <= 2


def test_the_processes_share_the_processors_unless_the_environment_says_how_many_threads_there_are(monkeypatch):
    pytest.importorskip("numba")
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    assert run(executed.threads, [(1,)], jobs=2)[0].result == 4
    assert run(executed.threads, [(1,)], jobs=16)[0].result == 1
    monkeypatch.setenv("NUMBA_NUM_THREADS", "3")
    assert run(executed.threads, [(1,)], jobs=2)[0].result == 3


def test_the_processes_stay_and_end_with_the_executor():
    with open_executor(ExecutorOptions(jobs=2)) as executor:
        ids = {o.result for o in executor.run((Task(n, executed.process_id, (n,)) for n in range(8)), int)}
        assert len(ids) <= 2
        assert os.getpid() not in ids
    for one in ids:
        with pytest.raises(ProcessLookupError):
            os.kill(one, 0)


@pytest.mark.real_time
def test_ctrl_c_loses_only_what_is_in_flight(tmp_path):
    tasks = (Task(n, executed.logged if n < 2 else executed.waits, (str(tmp_path), n)) for n in count())

    def press():
        while len(list(tmp_path.glob("begun-*"))) < 2:
            time.sleep(0.02)
        os.kill(os.getpid(), signal.SIGINT)

    presser = threading.Thread(target=press)
    ended, began = [], time.monotonic()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it may be ignored
    with open_executor(ExecutorOptions(jobs=2)) as executor:
        presser.start()
        with pytest.raises(KeyboardInterrupt):
            ended += [outcome.key for outcome in executor.run(tasks, int) if ended.append(outcome.key) is None]
    presser.join()
    signal.signal(signal.SIGINT, before)
    assert sorted(ended) == [0, 1]
    assert len(list(tmp_path.glob("begun-*"))) == 2
    assert time.monotonic() - began < 60.0


def test_jobs_below_zero_are_one_line():
    with pytest.raises(FlagError, match=r"--jobs: is too small: -1 \(limit: at least 1\)"):
        check_address(ExecutorOptions(jobs=-1))
