"""``agvbench export``: the driven and the planned poses of a campaign as TUM files, which evo and others read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agvbench.campaign import Campaign
from agvbench.campaign.arguments import as_campaign
from agvbench.campaign.atomic_files import made_folder, replace_whole
from agvbench.campaign.tables.parts import part_name
from agvbench.errors import FileError, FitError
from agvbench.metrics.planned_paths import PlannedPaths
from agvbench.types import Floats, Run

DRIVEN, PLANNED = "driven", "planned"


@dataclass(frozen=True)
class Exported:
    """The files that were written, and the ids of runs that were left out: not seen at rest before they began."""

    files: Sequence[Path]
    left_out: Sequence[str]


def export_tum(
    campaign: Campaign | str | Path, out: str | Path, *, track: Callable[[Sequence[Run]], Iterable[Run]] = iter
) -> Exported:
    """Write ``driven/RUN.tum`` and, where the plan is known, ``planned/RUN.tum`` of every run that counts into `out`.

    A line is ``t x y z qx qy qz qw`` (Sturm et al. 2012): time [s] since the first command, position [m] and the unit
    quaternion of the heading, both in the start frame, so that driven and planned poses need no alignment.

    Parameters
    ----------
    campaign
        A campaign, or its directory.
    out
        The directory; it is made if it is not there.
    track
        Wraps the runs while they are written, to show progress.

    Raises
    ------
    InputError
        If `campaign` is neither.
    CampaignError
        If the campaign cannot be read.
    FileError
        If `out` cannot be written.
    """
    opened, out = as_campaign(campaign), Path(out)
    paths, left_out, files = PlannedPaths(opened), list[str](), list[Path]()
    try:
        for run in track([run for run in opened if run.is_ok]):
            try:
                files += [_write(out / kind, run.run_id, poses) for kind, poses in _poses(run, paths)]
            except FitError:
                left_out.append(run.run_id)
    except OSError as error:
        raise FileError("cannot be written", where=out, value=error.strerror, remedy="choose another --out") from None
    return Exported(files, left_out)


def _poses(run: Run, paths: PlannedPaths) -> Iterator[tuple[str, Floats]]:
    measured = paths.measured(run)
    yield DRIVEN, measured.driven
    if measured.planned is not None:
        yield PLANNED, measured.planned


def _write(folder: Path, run_id: str, poses: Floats) -> Path:
    path = folder / part_name(run_id).replace(".parquet", ".tum")
    zero = np.zeros(len(poses))
    half = poses[:, 3] / 2.0
    rows = np.column_stack([poses[:, :3], zero, zero, zero, np.sin(half), np.cos(half)])
    with made_folder(folder):
        replace_whole(path.resolve(), lambda file: np.savetxt(file, rows, fmt="%.9f"), durable=False)
    return path
