"""A short campaign with a fault in its second run, through the whole loop in lock step; and resumed without."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fault_record import Outcome
from told_to_drive import Witness, witness

from agvbench.campaign import Campaign as Recorded
from agvbench.errors import AgvbenchError
from agvbench.running.configuration.campaign_directory import has_session
from agvbench.running.session.opening import open_session
from agvbench.running.session.session import BenchSession

SEED = 5
RUNS = ("before", "befallen", "after")
FROM_S = 0.6
"""When the fault begins, in the run's clock; `WHEN` says so to adapters."""
WHEN = f"@2/{FROM_S:g}"
RIGS = {"sim": ("sim", "natnet:emulated"), "simavr": ("simavr", "natnet:emulated")}


@dataclass(frozen=True)
class Campaign:
    """How to play a fault: what befalls vehicle and camera, options of the camera, or what to `do` when it is time.

    ``do`` gets the campaign's directory, in the middle of the second run; ``undo`` is called before the campaign is
    resumed.
    """

    agv: str = ""
    mocap: str = ""
    camera: str = ""
    do: Callable[[Path], None] | None = None
    undo: Callable[[Path], None] = lambda _: None
    workspace: str = "circle:12"
    hold_s: float = 1.4
    share: float = 0.6

    def __call__(self, directory: Path, rig: str) -> Outcome:
        """Play the fault on `rig`; return what came of it."""
        path = directory / "campaign"
        agv, mocap = RIGS[rig]
        struck = {"agv": _impaired(self.agv, agv), "mocap": _impaired(self.mocap, mocap), "camera": self.camera}
        with witness() as seen:
            said, last_s = self._drive(path, {**struck, "workspace": self.workspace}, seen)
        self.undo(path)
        statuses = _statuses(path)
        finished = _part(path, RUNS[0])
        resumed = self._resumed(path, {"agv": agv, "mocap": mocap, "camera": ""})
        intact = finished is not None and finished == _part(path, RUNS[0]) and finished == self._undisturbed(rig)
        reaction_s = None if last_s is None else max(0.0, last_s - FROM_S)
        rejected = next((status for status in statuses if status.startswith("rejected")), "")
        attempts = tuple(status.partition(":")[0] for status in statuses) or None
        return Outcome(reaction_s, said[0] or rejected, said[1], intact, resumed == "", attempts)

    @property
    def _hold(self) -> tuple[float, float]:
        return self.hold_s, self.share

    def _drive(self, path: Path, options: dict[str, Any], seen: Witness) -> tuple[tuple[str, str], float | None]:
        said: dict[str, str] = {}
        stops_s: list[float] = []
        given = {"vehicle": "", "seed": SEED, **options}
        # An interrupt ends the session, as it ends the program.
        with suppress(KeyboardInterrupt), open_session(given, out=str(path), resume=False, dry_run=False) as session:
            _before_retries(session, lambda: stops_s.append(seen.last_s()))
            if self.do is not None:
                _trip(session, partial(self.do, path))
            for number, name in enumerate(RUNS, 1):
                try:
                    said[name] = drive(session, name, number, self._hold)
                except KeyboardInterrupt as interrupt:
                    said[name] = f"{type(interrupt).__name__} {interrupt}".strip()
                    raise
                finally:
                    if said.get(name) and not stops_s:
                        stops_s.append(seen.last_s())
        return (said.get(RUNS[1], ""), said.get(RUNS[2], "")), stops_s[0] if stops_s else None

    def _resumed(self, path: Path, options: dict[str, Any]) -> str:
        """Go on without the fault; return what went wrong."""
        with open_session(
            {"vehicle": "", **options}, out=str(path), resume=has_session(path), dry_run=False
        ) as session:
            return "".join(drive(session, name, number, self._hold) for number, name in enumerate(RUNS, 1))

    def _undisturbed(self, rig: str) -> dict[str, bytes] | None:
        return _undisturbed(rig, self.camera, self.workspace, self._hold)


def _impaired(faults: str, adapter: str) -> str:
    return f"impaired:{'+'.join(f'{fault}{WHEN}' for fault in faults.split('+'))}:{adapter}" if faults else adapter


def drive(session: BenchSession, name: str, number: int, hold: tuple[float, float]) -> str:
    """Drive a run; return what it failed with, "" for nothing."""
    try:
        session.driver(name, experiment="free", repeat=number).hold(for_s=hold[0], drive=hold[1])
    except AgvbenchError as error:
        return str(error)
    except RuntimeError as error:
        return f"{type(error).__name__}: {error}"
    return ""


def _trip(session: BenchSession, do: Callable[[], None]) -> None:
    """Call `do` when the fault is to begin, between two slices of the second run."""
    assert session._bench is not None
    link, runs = session._bench.link, iter(range(1, 10))
    plain_reset, plain_control_cycle = link.reset, link.control_cycle
    state = {"run": 0, "done": 0}

    def reset(*args: Any, **keywords: Any) -> None:
        state["run"] = next(runs)
        plain_reset(*args, **keywords)

    def control_cycle(*args: Any, **keywords: Any) -> Any:
        if state["run"] == 2 and not state["done"] and keywords["t_s"] >= FROM_S - 1e-9:
            state["done"] = 1
            do()
        return plain_control_cycle(*args, **keywords)

    link.reset, link.control_cycle = reset, control_cycle  # type: ignore[method-assign]


def _before_retries(session: BenchSession, do: Callable[[], None]) -> None:
    """Call `do` when a run was stopped that is to be driven again."""
    bench = session._bench
    assert bench is not None
    plain = bench._stopped
    bench._stopped = lambda *stopped: (do(), plain(*stopped))[1]  # type: ignore[method-assign,func-returns-value]


def _part(path: Path, name: str) -> dict[str, bytes] | None:
    parts = [path / f"{table}.parquet" / f"{name}.parquet" for table in ("runs", "commands", "poses")]
    return {part.parent.name: part.read_bytes() for part in parts} if all(part.exists() for part in parts) else None


def _statuses(path: Path) -> list[str]:
    """Return what was recorded of the run that was befallen: the status of each attempt."""
    with suppress(AgvbenchError):
        found = {run.run_id: run.status for run in Recorded.open(path)}
        return [found[name] for name in sorted(found) if name.startswith(RUNS[1])]
    return []


@cache
def _undisturbed(rig: str, camera: str, workspace: str, hold: tuple[float, float]) -> dict[str, bytes] | None:
    """Return the first run's parts from a campaign in which nothing happened; a bad network is part of the rig."""
    agv, mocap = RIGS[rig]
    options = {"vehicle": "", "seed": SEED, "agv": agv, "mocap": mocap, "camera": camera, "workspace": workspace}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "campaign"
        with open_session(options, out=str(path), resume=False, dry_run=False) as session:
            drive(session, RUNS[0], 1, hold)
        return _part(path, RUNS[0])
