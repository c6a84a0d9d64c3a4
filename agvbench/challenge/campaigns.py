"""The campaigns of blind trials: driven by the bench in a process of its own, and kept if a folder is named."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from agvbench.errors import FileError, FlagError, PlantError
from agvbench.model.examples import example_path
from agvbench.running.configuration.benchmark_files import EXCITATION_RUNS
from agvbench.types import Kinematics

_PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
_PLANTS: Mapping[Kinematics, tuple[str, str | None]] = {
    "two_axle": ("agvbench.simulator.hidden", None),
    "differential": ("agvbench.simulator.hidden.differential", "differential"),
}
"""Where the hidden plants of a kind are, and the example of a vehicle file with which they are driven."""


@dataclass(frozen=True)
class TrialKind:
    """What trials share: how often each trajectory is driven, by what kind of vehicle, and where campaigns are kept.

    Without the folder ``campaigns`` they are deleted once they are diagnosed.
    """

    repeats: int
    kinematics: Kinematics = "two_axle"
    campaigns: Path | None = None


def campaigns_folder(path: str) -> Path:
    """Return the folder for campaigns that `path` names, and make it.

    Raises
    ------
    FlagError
        If it cannot be made.
    """
    folder = Path(path).resolve()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FlagError("is no folder to keep campaigns in", where="--campaigns", value=f"{path}: {error.strerror}",
                        remedy="name a folder you may write to") from None  # fmt: skip
    return folder


@contextmanager
def driven_campaign(spec: str, seed: int, kind: TrialKind) -> Iterator[Path]:
    """Yield the directory of the campaign of a trial: one that was kept, or one that is driven now.

    Raises
    ------
    PlantError
        If the bench cannot drive the plant.
    FileError
        If the campaign cannot be kept.
    """
    folder = None if kind.campaigns is None else str(kind.campaigns)
    kept = None if kind.campaigns is None else kind.campaigns / f"{kind.kinematics}-{spec}-{seed}-{kind.repeats}"
    if kept is not None and kept.exists():
        yield kept
        return
    # It is renamed once it is complete: what an interruption left is not taken for a campaign.
    with tempfile.TemporaryDirectory(prefix="agvbench-challenge-", dir=folder) as temporary:
        directory = Path(temporary) / "campaign"
        drive_campaign(spec, seed, kind, directory)
        if kept is None:
            yield directory
            return
        try:
            directory.rename(kept)
        except OSError as error:
            raise FileError("cannot be kept", where=kept, value=error.strerror, remedy="name another folder") from None
    yield kept


def drive_campaign(spec: str, seed: int, kind: TrialKind, directory: Path) -> None:
    """Drive the vehicle of a trial with `agvbench bench`, which writes the campaign to `directory`.

    Raises
    ------
    PlantError
        If it ends with an error; rejected runs are none.
    """
    module, vehicle = _PLANTS[kind.kinematics]
    options = [
        f"--plant={module}:{spec}",
        *([] if vehicle is None else [f"--vehicle={example_path(vehicle)}"]),
        f"--seed={seed}",
        f"--repeats={kind.repeats}",
        "--no-report",
        "--exchange=2",
    ]
    command = [sys.executable, "-c", _PROGRAM, "bench", *EXCITATION_RUNS, *options, f"--out={directory}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - our own program
    if done.returncode not in {0, 1}:
        said = " ".join((done.stderr or done.stdout).split())
        raise PlantError("the bench could not drive this plant", where=f"{spec}, seed {seed}", value=said[-300:])
