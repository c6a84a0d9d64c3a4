"""Processes of this machine: one task at a time in each, so that a process that dies is known by its task."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any, ClassVar

from agvbench.executors.executor import RETRIES, Executor, ExecutorOptions, in_flight
from agvbench.executors.task import VERSIONS, Failed, Key, Outcome, Result, Task, failure, outcome_of, run_task

# Not a fork, which would copy the locks of threads that it does not copy, such as those of the bus; nor a spawn of
# multiprocessing, which would run the user's script once more.
_PROGRAM = "import sys; from agvbench.executors.kinds.processes import serve; serve(int(sys.argv[1]))"
_PATIENCE_S = 5.0


class ProcessExecutor(Executor):
    """Runs tasks in `jobs` processes, started when they are needed; a process that dies is replaced."""

    schemes: ClassVar[tuple[str, ...]] = ("",)

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._workers: list[_Worker] = []

    @classmethod
    def check(cls, options: ExecutorOptions) -> None:
        """Refuse nothing: processes of this machine need no address."""

    @classmethod
    def open(cls, options: ExecutorOptions) -> ProcessExecutor:
        """Return an executor without processes yet."""
        return cls(options.jobs or os.cpu_count() or 1)

    def run(self, tasks: Iterable[Task[Key]], kind: type[Result]) -> Iterator[Outcome[Key, Result]]:
        """Yield the outcome of each task as it ends."""
        coming, deaths = iter(tasks), dict[Key, int]()
        busy: dict[_Worker, Task[Key]] = {}
        while True:
            for task in in_flight(coming, len(busy), self._jobs):
                busy[self._give(task, busy)] = task
            if not busy:
                return
            for worker in _ended(list(busy)):
                task = busy.pop(worker)
                answer = worker.take()
                if answer is None:
                    self._workers.remove(worker)
                    deaths[task.key] = deaths.get(task.key, 0) + 1
                    if deaths[task.key] <= RETRIES:
                        busy[self._give(task, busy)] = task
                        continue
                    yield Failed(task.key, f"{worker.cause}, {deaths[task.key]} times")
                else:
                    yield outcome_of(task.key, answer, kind)

    def close(self) -> None:
        """End every process, by SIGTERM where it runs a task."""
        for worker in self._workers:
            worker.end()
        for worker in self._workers:
            worker.join()
        self._workers.clear()

    def _give(self, task: Task[Key], busy: Iterable[_Worker]) -> _Worker:
        """Hand a task to an idle process, or to a new one."""
        idle = [worker for worker in self._workers if worker not in busy and worker.is_alive]
        worker = idle[0] if idle else _Worker(max(1, (os.cpu_count() or 1) // self._jobs))
        if not idle:
            self._workers.append(worker)
        worker.give(task)
        return worker


class _Worker:
    """A process that runs one task at a time.

    It simulates in as many `threads`, unless the environment says in how many.
    """

    def __init__(self, threads: int) -> None:
        self.connection, theirs = Pipe()
        number = theirs.fileno()
        command = [sys.executable, "-c", _PROGRAM, str(number)]
        environment = {"NUMBA_NUM_THREADS": str(threads)} | os.environ
        self._process = subprocess.Popen(command, pass_fds=(number,), env=environment)  # noqa: S603 - our own program
        theirs.close()
        self._send(sys.path)

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    @property
    def cause(self) -> str:
        """Why it died, in words."""
        code = self._process.returncode
        if code < 0:
            return f"process was killed by {signal.Signals(-code).name}"
        return f"process ended with exit code {code}"

    def give(self, task: Task[Any]) -> None:
        self._send((task.function, task.arguments, VERSIONS))

    def _send(self, content: object) -> None:
        with suppress(OSError):  # a process that has died is seen by `take`
            self.connection.send(content)

    def take(self) -> bytes | None:
        """Return the bytes of an answer; None where the process died."""
        try:
            return self.connection.recv_bytes()
        except (EOFError, OSError):
            self.join()
            return None

    def end(self) -> None:
        self.connection.close()
        self._process.terminate()

    def join(self) -> None:
        """Wait until the process has ended; kill one that does not."""
        try:
            self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self.connection.close()


def _ended(workers: list[_Worker]) -> list[_Worker]:
    """Return those that have answered or died; wait until one has."""
    by_connection: dict[Any, _Worker] = {worker.connection: worker for worker in workers}
    return [by_connection[connection] for connection in wait(list(by_connection))]


def serve(number: int) -> None:
    """Run the tasks that come through the connection of this file number until the client closes it, or SIGTERM.

    Ctrl-C reaches every process of a terminal: here the client decides. The handler is not inherited by programs that
    a task starts, so that these are interrupted themselves.
    """
    signal.signal(signal.SIGINT, lambda *_: None)
    signal.signal(signal.SIGTERM, _leave)
    connection = Connection(number)
    with suppress(EOFError, OSError, _Left):
        try:
            sys.path[:] = connection.recv()
            while True:
                connection.send_bytes(_answer(connection))
        finally:  # it ends already: in what Python tidies up now, an exception would be printed
            signal.signal(signal.SIGTERM, signal.SIG_IGN)


def _answer(connection: Connection) -> bytes:
    """Return the answer to the next task; the failure of one whose function this process cannot import."""
    try:
        function, arguments, versions = connection.recv()
    except (EOFError, OSError):
        raise
    except Exception as error:  # noqa: BLE001 - whatever the module raises that is imported
        return failure(error)
    return run_task(function, arguments, versions)


def _leave(*_: object) -> None:
    """End with the programs that a task has started: `subprocess.run` kills its own on an exception."""
    raise _Left


class _Left(BaseException):
    """SIGTERM: not to be taken for an error of the task."""
