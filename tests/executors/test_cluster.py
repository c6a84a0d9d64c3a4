"""Tasks on Dask workers, which are processes of their own here, over TCP on loopback."""

from __future__ import annotations

import subprocess
import time
from itertools import count

import executed
import msgspec
import pytest

from agvbench.errors import FileError, FlagError, LinkError
from agvbench.executors import Done, ExecutorOptions, Failed, Task, check_address, open_executor
from agvbench.executors.task import VERSIONS, outcome_of, require_same_versions, run_task

pytest.importorskip("distributed")


def run(cluster, function, arguments, kind=int):
    tasks = [Task(n, function, one) for n, one in enumerate(arguments)]
    with open_executor(ExecutorOptions(cluster.address)) as executor:
        return {outcome.key: outcome for outcome in executor.run(tasks, kind)}


@pytest.mark.real_time
def test_workers_run_tasks_and_failures_end_nothing(dask_cluster):
    assert run(dask_cluster, executed.square, [(float(n),) for n in range(6)], float) == {
        n: Done(n, float(n * n)) for n in range(6)
    }
    found = run(dask_cluster, executed.fails, [(n,) for n in range(5)])
    assert [found[n].result for n in (0, 1, 4)] == [0, 1, 4]
    assert found[2] == Failed(2, "number 2: nothing to fit")
    assert found[3].was_raised
    assert len({o.result for o in run(dask_cluster, executed.process_id, [(n, 0.3) for n in range(6)]).values()}) == 2


@pytest.mark.real_time
def test_few_tasks_are_at_the_scheduler_however_many_there_are(dask_cluster, tmp_path):
    endless = (Task(n, executed.logged, (str(tmp_path), n)) for n in count())
    with open_executor(ExecutorOptions(dask_cluster.address)) as executor:
        outcomes = executor.run(endless, int)
        ended = [next(outcomes).key for _ in range(10)]
        assert len(executor._held) <= 4
    time.sleep(1.0)
    assert len({path.name.split("-")[0] for path in tmp_path.iterdir()} - set(map(str, ended))) <= 4


@pytest.mark.real_time
def test_a_worker_that_is_killed_loses_no_task(start_cluster, tmp_path):
    cluster = start_cluster()
    workers = [cluster.add_worker(), cluster.add_worker()]
    with open_executor(ExecutorOptions(cluster.address)) as executor:
        executor._client.wait_for_workers(2, timeout=60)
        tasks = [Task(n, executed.waits, (str(tmp_path), n)) for n in range(4)]
        outcomes = executor.run(iter(tasks), int)
        first = next_in_thread(outcomes)
        until(lambda: len(list(tmp_path.glob("begun-*"))) == 2)
        workers[0].kill()
        workers[0].wait()
        (tmp_path / "go").touch()
        found = {outcome.key: outcome for outcome in (first(), *outcomes)}
    assert found == {n: Done(n, n) for n in range(4)}


@pytest.mark.real_time
@pytest.mark.slow
def test_a_task_that_kills_every_worker_is_a_failure_with_its_cause(start_cluster, tmp_path):
    cluster = start_cluster()
    for _ in range(5):
        cluster.add_worker()
    with open_executor(ExecutorOptions(cluster.address)) as executor:
        executor._client.wait_for_workers(5, timeout=60)
        tasks = [Task(0, executed.dies, (str(tmp_path), 0, 99))]
        (outcome,) = executor.run(tasks, int)
        assert isinstance(outcome, Failed)
        assert "KilledWorker" in outcome.cause
        assert len(list(tmp_path.iterdir())) == 4
        assert [o.result for o in executor.run([Task(1, executed.square, (3.0,))], float)] == [9.0]


@pytest.mark.real_time
def test_a_worker_with_several_threads_is_refused_in_one_line(start_cluster):
    cluster = start_cluster()
    cluster.add_worker("--nthreads", "2")
    with pytest.raises(LinkError, match=r"worker has several threads: 2 \(limit: 1\); start it with --nthreads 1"):
        open_executor(ExecutorOptions(cluster.address))


@pytest.mark.real_time
def test_a_scheduler_that_does_not_answer_is_one_line(free_port, monkeypatch):
    monkeypatch.setattr("agvbench.executors.kinds.cluster._PATIENCE_S", 1.0)
    with pytest.raises(LinkError, match=r"--cluster tcp://127.0.0.1:\d+: no scheduler answers") as caught:
        open_executor(ExecutorOptions(f"tcp://127.0.0.1:{free_port()}"))
    assert "\n" not in str(caught.value)


def test_other_versions_are_refused_at_the_start_and_by_a_worker_that_joins_later():
    old = ("agvbench 0.1.0", "Python 3.11.2")
    with pytest.raises(LinkError) as caught:
        require_same_versions({"tcp://b": old, "tcp://a": VERSIONS}, "--cluster tcp://s")
    assert str(caught.value) == (
        "--cluster tcp://s: tcp://b: worker has other versions than the client: agvbench 0.1.0 and Python 3.11.2 "
        f"(limit: {VERSIONS[0]} and {VERSIONS[1]}); install the same agvbench and Python there"
    )
    outcome = outcome_of(1, run_task(executed.square, (2.0,), old), float)
    assert outcome.cause == f"worker has {VERSIONS[0]} and {VERSIONS[1]}, the client agvbench 0.1.0 and Python 3.11.2"


@pytest.mark.parametrize(
    "answer", [None, object(), b"", b"\x93\x01", msgspec.msgpack.encode({"result": [1]}), b"\x81\xa5cause\xa2\xff\xfe"]
)
def test_what_a_worker_returns_is_validated(answer):
    outcome = outcome_of(7, answer, int)
    assert isinstance(outcome, Failed)
    assert outcome.cause.startswith("worker returned ")
    assert "\n" not in outcome.cause


REFUSED = "a program that answers at this address can run code here"


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (ExecutorOptions("tcp://192.168.0.9:8786"), REFUSED),
        (ExecutorOptions("tcp://lab-pc:8786"), REFUSED),
        (ExecutorOptions("tcp://[2001:db8::1]:8786"), REFUSED),
        (ExecutorOptions("tcp://0.0.0.0:8786"), REFUSED),
        (ExecutorOptions("tls://192.168.0.9:8786"), "--tls-ca-file: tls:// needs certificates; add --tls-ca-file FILE"),
        (ExecutorOptions("ucx://127.0.0.1:1"), "address cannot be used: 'ucx://127.0.0.1:1' (one of: tcp://HOST:PORT"),
        (ExecutorOptions("127.0.0.1:8786"), "address cannot be used: '127.0.0.1:8786' (one of: tcp://HOST:PORT"),
        (ExecutorOptions("tcp://127.0.0.1"), "address cannot be used: 'tcp://127.0.0.1' (limit: tcp://HOST:PORT"),
        (ExecutorOptions("tcp://127.0.0.1:99999"), "address cannot be used: 'tcp://127.0.0.1:99999'"),
        (ExecutorOptions("tcp://me:key@127.0.0.1:1"), "address cannot be used: "),
    ],
)
def test_what_a_network_could_answer_is_refused_before_anything_is_opened(options, line):
    with pytest.raises(FlagError) as caught:
        check_address(options)
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:8786", "tcp://localhost:8786", "tcp://[::1]:8786"])
def test_loopback_needs_no_certificate_and_insecure_says_that_a_network_is_trusted(address):
    assert check_address(ExecutorOptions(address)).schemes == ("tcp", "tls")
    assert check_address(ExecutorOptions("tcp://192.168.0.9:8786", insecure=True)).schemes == ("tcp", "tls")


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    """A certificate that is its own authority, for scheduler, workers and client alike."""
    folder = tmp_path_factory.mktemp("certificates")
    certificate, key = folder / "lab.pem", folder / "lab.key"
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=lab",
         "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", key, "-out", certificate],
        check=True, capture_output=True,
    )  # fmt: skip
    return certificate, key


def test_files_that_are_no_certificates_are_one_line(certificates, tmp_path):
    certificate, key = certificates
    wrong = tmp_path / "wrong.pem"
    wrong.write_text("no certificate")
    for files in ((wrong, certificate, key), (certificate, wrong, key), (certificate, certificate, tmp_path / "none")):
        with pytest.raises(FileError) as caught:
            check_address(ExecutorOptions("tls://10.0.0.1:8786", None, False, *files))
        assert "\n" not in str(caught.value)


@pytest.mark.real_time
def test_a_scheduler_over_tls_takes_a_client_with_certificates_and_no_other(start_cluster, certificates, monkeypatch):
    certificate, key = certificates
    files = ("--tls-ca-file", str(certificate), "--tls-cert", str(certificate), "--tls-key", str(key))
    cluster = start_cluster("--protocol", "tls", *files)
    cluster.address = cluster.address.replace("tcp://", "tls://")
    cluster.add_worker()
    options = ExecutorOptions(cluster.address, None, False, certificate, certificate, key)
    with open_executor(options) as executor:
        assert [o.result for o in executor.run([Task(0, executed.square, (3.0,))], float)] == [9.0]
    monkeypatch.setattr("agvbench.executors.kinds.cluster._PATIENCE_S", 2.0)
    with pytest.raises(LinkError, match="no scheduler answers"):
        open_executor(ExecutorOptions(cluster.address.replace("tls://", "tcp://")))


def next_in_thread(outcomes):
    """Begin to wait for the next outcome; return what returns it."""
    from concurrent.futures import ThreadPoolExecutor

    pool = ThreadPoolExecutor(1)
    future = pool.submit(next, outcomes)
    pool.shutdown(wait=False)
    return lambda: future.result(timeout=120)


def until(holds, limit_s=60.0):
    end = time.monotonic() + limit_s
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)
