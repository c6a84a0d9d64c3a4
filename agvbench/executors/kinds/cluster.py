"""Workers of a Dask cluster, on any number of machines."""

from __future__ import annotations

import logging
import math
import ssl
import time
import uuid
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar
from urllib.parse import urlsplit

from agvbench.errors import FileError, FlagError, LinkError
from agvbench.executors.executor import FLAG, Executor, ExecutorOptions, in_flight
from agvbench.executors.task import (
    VERSIONS,
    Failed,
    Key,
    Outcome,
    Result,
    Task,
    in_one_line,
    outcome_of,
    require_same_versions,
    run_task,
    versions,
)
from agvbench.loopback import is_loopback

if TYPE_CHECKING:
    from distributed import Client, Future

_PATIENCE_S = 15.0
_REFRESH_S = 2.0
_QUEUED = 2
"""Tasks in flight for each worker: one that runs, and one that waits while the client reads an answer."""


class ClusterExecutor(Executor):
    """Runs tasks on the workers of a Dask scheduler, which may come and go; each runs one at a time.

    The scheduler gives the tasks of a worker that dies to others, as often as its ``allowed-failures`` says (3).
    """

    schemes: ClassVar[tuple[str, ...]] = ("tcp", "tls")

    def __init__(self, client: Client, address: str) -> None:
        self._client, self._address = client, address
        self._held: dict[Future[bytes], Any] = {}
        self._known, self._asked_s = 1, -math.inf

    @classmethod
    def check(cls, options: ExecutorOptions) -> None:
        """Refuse what is no address, and a connection over a network that nothing protects.

        Python objects come back from a scheduler and its workers as pickles, which can contain any program.
        """
        url = urlsplit(options.address)
        try:
            host, port = url.hostname, url.port
        except ValueError:
            host, port = None, None
        if not host or not port or url.path or url.query or url.fragment or url.username:
            raise FlagError(
                "address cannot be used",
                where=FLAG,
                value=repr(options.address),
                limit="tcp://HOST:PORT, tls://HOST:PORT",
            )
        if url.scheme == "tls":
            _require_certificates(options)
        elif not (is_loopback(host) or options.insecure):
            raise FlagError(
                "a program that answers at this address can run code here, without encryption or certificates",
                where=FLAG, value=options.address, limit="tcp:// on loopback, or tls:// with certificates",
                remedy="use tls://, or add --insecure on a network that you trust",
            )  # fmt: skip

    @classmethod
    def open(cls, options: ExecutorOptions) -> ClusterExecutor:
        """Connect to a scheduler with at least one worker, whose versions and threads are checked."""
        client = _connected(options)
        try:
            _require_workers(client, options.address)
        except BaseException:
            client.close(timeout=_PATIENCE_S)
            raise
        return cls(client, options.address)

    def run(self, tasks: Iterable[Task[Key]], kind: type[Result]) -> Iterator[Outcome[Key, Result]]:
        """Yield the outcome of each task as it ends."""
        from distributed import wait

        coming = iter(tasks)
        while True:
            for task in in_flight(coming, len(self._held), _QUEUED * self._workers()):
                self._held[self._submitted(task)] = task.key
            if not self._held:
                return
            try:
                with self._client.as_current():
                    ended = wait(list(self._held), return_when="FIRST_COMPLETED").done
            except Exception as error:
                raise self._gone(error) from error
            for future in ended:
                yield self._outcome(future, self._held.pop(future), kind)

    def close(self) -> None:
        """Cancel what is in flight, and leave; what a worker has begun it ends, and its result is dropped."""
        with suppress(Exception):  # the scheduler may be gone
            if self._held:
                self._client.cancel(list(self._held), force=True)
        self._held.clear()
        with suppress(Exception):
            self._client.close(timeout=_PATIENCE_S)

    def _workers(self) -> int:
        """Return how many workers there are, at least one; the scheduler is asked from time to time."""
        now_s = time.monotonic()
        if now_s >= self._asked_s + _REFRESH_S:
            self._known, self._asked_s = max(1, len(self._client.nthreads())), now_s
        return self._known

    def _submitted(self, task: Task[Any]) -> Future[bytes]:
        key = f"agvbench-{task.function.__name__}-{uuid.uuid4().hex}"
        return self._client.submit(_run_alone, task.function, task.arguments, VERSIONS, key=key, pure=False)

    def _outcome(self, future: Future[bytes], key: Key, kind: type[Result]) -> Outcome[Key, Result]:
        status = future.status
        if status == "finished":
            try:
                return outcome_of(key, future.result(timeout=_PATIENCE_S), kind)
            except Exception as error:  # noqa: BLE001 - the worker that held it died before it was read
                return Failed(key, f"result was lost: {type(error).__name__} {in_one_line(error)}")
        if status == "error":
            cause = future.exception(timeout=_PATIENCE_S)
            return Failed(key, f"worker died or could not run it: {type(cause).__name__} {in_one_line(cause)}")
        raise self._gone(status)

    def _gone(self, cause: object) -> LinkError:
        remedy = "start it, and go on with --resume"
        return LinkError("scheduler is gone", where=self._address, value=in_one_line(cause) or None, remedy=remedy)


def _connected(options: ExecutorOptions) -> Client:
    try:
        from distributed import Client, Security
    except ImportError:
        raise FlagError(
            "needs a library that is not installed", where=FLAG, value="distributed",
            remedy='install it with pip install "agvbench[cluster]"',
        ) from None  # fmt: skip
    for name in ("distributed", "distributed.client", "distributed.core", "distributed.comm"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what goes wrong is said in one line, by us
    is_secured = options.address.startswith("tls://")
    security = Security(
        require_encryption=is_secured, tls_ca_file=_text(options.tls_ca_file),
        tls_client_cert=_text(options.tls_cert), tls_client_key=_text(options.tls_key),
    ) if is_secured else None  # fmt: skip
    try:
        return Client(
            options.address, security=security, timeout=_PATIENCE_S, set_as_default=False, direct_to_workers=False
        )
    except (OSError, TimeoutError) as error:
        raise LinkError(
            "no scheduler answers", where=f"{FLAG} {options.address}", value=in_one_line(error),
            remedy="start one with dask scheduler, and workers with dask worker",
        ) from None  # fmt: skip


def _require_workers(client: Client, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_PATIENCE_S)
    except TimeoutError:
        raise LinkError(
            f"scheduler has had no worker for {_PATIENCE_S:g} s", where=f"{FLAG} {address}",
            remedy=f"start some with dask worker {address} --nthreads 1",
        ) from None  # fmt: skip
    for name, threads in client.nthreads().items():
        _require_one_thread(name, threads)
    try:
        found = client.run(versions)
    except Exception as error:
        raise LinkError(
            "workers cannot import agvbench", where=f"{FLAG} {address}", value=in_one_line(error),
            remedy=f"install {' and '.join(VERSIONS)} there",
        ) from error  # fmt: skip
    require_same_versions(found, f"{FLAG} {address}")


def _require_one_thread(name: str, threads: int) -> None:
    """Raise `LinkError` unless a worker runs one task at a time: libraries of a diagnosis do not share a process."""
    if threads != 1:
        raise LinkError(
            "worker has several threads", where=name, value=threads, limit="1",
            remedy="start it with --nthreads 1 --nworkers N",
        )  # fmt: skip


def _run_alone(function: Any, arguments: tuple[Any, ...], client_versions: tuple[str, ...]) -> bytes:
    """Run a task on this worker, which may have joined after the client looked at all."""
    from distributed import get_worker

    worker = get_worker()
    _require_one_thread(worker.address, worker.state.nthreads)
    return run_task(function, arguments, client_versions)


def _text(path: object) -> str | None:
    return None if path is None else str(path)


def _require_certificates(options: ExecutorOptions) -> None:
    """Check the files of an address ``tls://``.

    Raises
    ------
    FlagError
        If one of the three is not given.
    FileError
        If one of them is missing or no certificate, or the key is not that of the certificate.
    """
    files = {"--tls-ca-file": options.tls_ca_file, "--tls-cert": options.tls_cert, "--tls-key": options.tls_key}
    for flag, file in files.items():
        if file is None:
            raise FlagError("tls:// needs certificates", where=flag, remedy=f"add {flag} FILE")
        if not file.is_file():
            raise FileError("there is no such file", where=file, remedy=f"correct {flag}")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        context.load_verify_locations(options.tls_ca_file)
    except (OSError, ValueError) as error:
        raise _unusable(options.tls_ca_file, error) from None
    try:
        # Without an answer here, Python would ask for the password of an encrypted key.
        context.load_cert_chain(str(options.tls_cert), options.tls_key, password=lambda: "")
    except (OSError, ValueError) as error:
        raise _unusable(f"{options.tls_cert} and {options.tls_key}", error) from None


def _unusable(where: Path | str | None, error: OSError | ValueError) -> FileError:
    reason = getattr(error, "reason", None) or str(error)
    return FileError(
        "certificate cannot be used", where=where, value=reason, remedy="see docs/how-to/secure-the-bus.md"
    )
