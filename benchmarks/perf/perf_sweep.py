"""How much sooner a sweep ends on two processes and on two Dask workers over TCP, and what a campaign costs.

Drives one grid three times (a cell at a time, on two processes, on two workers), and prints for each the load of the
machine before it, the elapsed time and the speed-up, and whether ``results.parquet`` has the same bytes. Then the costs
of a campaign, of a task without work, and of a row of the results, from which docs/how-to/plan-a-large-sweep.md plans.

``--seeds 8 --repeats 10`` by default: calibration and the eight trajectories, as ``agvbench bench`` drives them.
``--smallest`` drives two cells of one trajectory, to see that everything works. The target of 1.7
is for two free cores.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from operator import index
from pathlib import Path
from random import Random

import msgspec
from distributed import LocalCluster

from agvbench.executors import ExecutorOptions, Failed, Task, open_executor
from agvbench.workflows.sweep import SweepResult, run_sweep
from agvbench.workflows.sweep.axes import Axis
from agvbench.workflows.sweep.cell import MARK, CellResult
from agvbench.workflows.sweep.grid import Grid
from agvbench.workflows.sweep.results import write_results
from agvbench.workflows.sweep.store import CellStore, Line, header

WANTED = 1.7
WORKERS = 2
GRID = """
benchmarks = {benchmarks}
[fixed]
{fixed}
[grid]
seed = "1..{seeds}"
"""


def _grid(folder: Path, arguments: argparse.Namespace) -> Path:
    fixed = f"repeats = {arguments.repeats}"
    benchmarks, seeds = '["calibration", "trajectories"]', arguments.seeds
    if arguments.smallest:
        fixed, seeds, benchmarks = 'repeats = 1\ntrajectories = "1"\nexchange = 2.0', 2, '["trajectories"]'
    (folder / "grid.toml").write_text(GRID.format(benchmarks=benchmarks, fixed=fixed, seeds=seeds))
    return folder / "grid.toml"


def _timed(act: Callable[[], object]) -> float:
    began = time.perf_counter()
    act()
    return time.perf_counter() - began


def _compare(folder: Path, grid: Path, ways: dict[str, ExecutorOptions]) -> SweepResult:
    """Drive the grid each way, and print what each took."""
    serial_s, bytes_of, result = 0.0, {}, None
    for name, options in ways.items():
        load = os.getloadavg()[0]
        began = time.perf_counter()
        result = run_sweep(grid, folder / name, options)
        elapsed_s = time.perf_counter() - began
        serial_s = serial_s or elapsed_s
        bytes_of[name] = result.parquet.read_bytes()
        if result.failed:
            raise SystemExit(f"{name}: {dict(result.failed)}")
        print(
            f"{name:10s} load before {load:5.2f}   {elapsed_s:8.1f} s   speed-up {serial_s / elapsed_s:5.2f}"
            f"   same bytes: {bytes_of[name] == next(iter(bytes_of.values()))}"
        )
    print(f"wanted: speed-up of at least {WANTED} on {WORKERS} free cores; this machine has {os.cpu_count()}")
    return result


def _results(folder: Path) -> list[CellResult]:
    lines = (folder / MARK).read_bytes().splitlines()[1:]
    found = [msgspec.json.decode(line, type=Line).result for line in lines]
    return [one for one in found if one is not None]


def _print_costs(folder: Path) -> None:
    found = _results(folder)
    costs = [one.cost for one in found]
    line_bytes = (folder / MARK).stat().st_size / len(found)
    rows = sum(len(one.rows) for one in found)
    print(f"\none campaign (median of {len(found)}, a cell at a time):")
    for name in ("elapsed_s", "processor_s", "memory_bytes", "campaign_bytes"):
        print(f"  {name:16s} {statistics.median(getattr(cost, name) for cost in costs):14.1f}")
    print(f"  {'line in record':16s} {line_bytes:14.1f} bytes")
    print(f"  {'rows of results':16s} {rows / len(found):14.1f}")
    parquet = (folder / "results.parquet").stat().st_size
    print(f"  {'results.parquet':16s} {parquet / len(found):14.1f} bytes, with the fixed part of a small file")


def _print_task_costs(ways: dict[str, ExecutorOptions], tasks: int) -> None:
    print(f"\na task without work (mean of {tasks}):")
    for name, options in ways.items():
        with open_executor(options) as executor:
            list(executor.run([Task(n, index, (n,)) for n in range(4)], int))  # workers have started
            seconds = _timed(lambda executor=executor: _run_all(executor, tasks))
        print(f"  {name:10s} {1e3 * seconds / tasks:8.2f} ms, {tasks / seconds:8.0f} tasks/s")


def _run_all(executor: object, tasks: int) -> None:
    outcomes = executor.run((Task(n, index, (n,)) for n in range(tasks)), int)  # type: ignore[attr-defined]
    if failed := [one for one in outcomes if isinstance(one, Failed)]:
        raise SystemExit(failed[0].cause)


def _another(result: CellResult, draw: Random) -> CellResult:
    rows = [
        msgspec.structs.replace(row, medians={name: draw.uniform(0.0, 100.0) for name in row.medians})
        for row in result.rows
    ]
    return msgspec.structs.replace(result, rows=tuple(rows), sha256=draw.randbytes(32).hex())


def _print_result_costs(folder: Path, result: CellResult, cells: int) -> None:
    """Print what recording, resuming and writing take for many cells, with random numbers in the form of `result`."""
    folder.mkdir()
    grid = Grid(("trajectories",), {}, (Axis("seed", "", range(cells)),))
    first = header(grid.digest, "", diagnose=False)
    store = CellStore.create(folder, first)
    lines = [Line(cell, _another(result, Random(cell))) for cell in range(cells)]  # noqa: S311
    recorded_s = _timed(lambda: [store.add(line) for line in lines])
    store.close()
    resumed: list[CellStore] = []
    resumed_s = _timed(lambda: resumed.append(CellStore.resume(folder, first, cells)))
    tracemalloc.start()
    resumed = [CellStore.resume(folder, first, cells)]
    written_s = _timed(lambda: write_results(folder, grid, resumed[0], diagnose=False))
    memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    print(f"\n{cells} recorded cells with {len(result.rows)} rows each, per cell:")
    for name, value, unit in (
        ("record", 1e3 * recorded_s / cells, "ms, on the disk"),
        ("read to resume", 1e3 * resumed_s / cells, "ms"),
        ("write tables", 1e3 * written_s / cells, "ms, while memory is traced"),
        (MARK, (folder / MARK).stat().st_size / cells, "bytes"),
        ("results.parquet", (folder / "results.parquet").stat().st_size / cells, "bytes"),
        ("results.csv", (folder / "results.csv").stat().st_size / cells, "bytes"),
    ):
        print(f"  {name:16s} {value:10.2f} {unit}")
    print(
        f"  {'client, all':16s} {memory / 2**20:10.1f} MiB of memory that Python allocated to resume and write, at most"
    )


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--tasks", type=int, default=2000, help="tasks without work")
    parser.add_argument("--cells", type=int, default=20000, help="recorded cells")
    parser.add_argument("--smallest", action="store_true")
    arguments = parser.parse_args()
    tasks, cells = (200, 500) if arguments.smallest else (arguments.tasks, arguments.cells)
    with (
        tempfile.TemporaryDirectory() as temporary,
        LocalCluster(
            n_workers=WORKERS, threads_per_worker=1, protocol="tcp", host="127.0.0.1", dashboard_address="127.0.0.1:0"
        ) as cluster,
    ):
        folder = Path(temporary)
        ways = {
            "serial": ExecutorOptions(jobs=1),
            "processes": ExecutorOptions(jobs=WORKERS),
            "cluster": ExecutorOptions(cluster.scheduler_address),
        }
        _compare(folder, _grid(folder, arguments), ways)
        _print_costs(folder / "serial")
        _print_task_costs(ways, tasks)
        _print_result_costs(folder / "many", _results(folder / "serial")[0], cells)


if __name__ == "__main__":
    main()
