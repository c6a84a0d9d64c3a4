"""A diagnosis as it lies in a campaign directory: its JSON, and the residuals to be drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agvbench.errors import FileError
from agvbench.text_files import read_json
from agvbench.workflows.writing import write_file

if TYPE_CHECKING:
    import pandas as pd

    from agvbench.diagnosis import Diagnosis

JSON, RESIDUALS = "diagnosis.json", "residuals.parquet"
_NUMBERS = (
    "time_in_run_s", "speed_mps", "curvature_per_m", "direction", "campaign_time_h", "x_m", "y_m", "length_m",
    *(f"{when}_{feature}" for when in ("before", "after") for feature in ("speed", "sideways", "turning")),
)  # fmt: skip


@dataclass(frozen=True)
class ShownDiagnosis:
    """The ``content`` of the JSON (schema 1), and the ``residuals``, or None where they were not kept."""

    content: Mapping[str, Any]
    residuals: pd.DataFrame | None = None
    problems: tuple[str, ...] = field(default_factory=tuple)


def shown(found: Diagnosis) -> ShownDiagnosis:
    """Return a diagnosis just made, to be reported."""
    return ShownDiagnosis(found.to_json(), found.residuals)


def keep(found: Diagnosis, json_file: Path) -> None:
    """Write the residuals beside the JSON where that is a campaign's own `JSON`."""
    if json_file.name == JSON and (json_file.parent / "campaign.toml").exists():
        keep_residuals(found, json_file.parent)


def keep_residuals(found: Diagnosis, directory: Path) -> None:
    """Write the residuals into a directory in which the JSON lies.

    Raises
    ------
    FileError
        If they cannot be written.
    """
    residuals = found.residuals
    if residuals is not None:
        write_file("--json", directory / RESIDUALS, lambda path: residuals.to_parquet(path, index=False))


def read_diagnosis(directory: Path) -> ShownDiagnosis | None:
    """Return the diagnosis that lies in a campaign directory, or None if there is none.

    What cannot be read is said in ``problems``, not raised: a report is of the campaign first.
    """
    path = directory / JSON
    if not path.exists():
        return None
    try:
        content = read_json(path)
    except (OSError, ValueError, FileError) as error:
        return ShownDiagnosis({}, None, (f"{JSON} cannot be read: {error}.",))
    if not isinstance(content, dict) or content.get("schema") != 1:
        return ShownDiagnosis({}, None, (f"{JSON} is not a diagnosis of schema 1.",))
    residuals, problems = _residuals(directory / RESIDUALS)
    return ShownDiagnosis(content, residuals, problems)


def _residuals(path: Path) -> tuple[pd.DataFrame | None, tuple[str, ...]]:
    import numpy as np
    import pandas as pd

    if not path.exists():
        return None, ()
    try:
        table = pd.read_parquet(path)
        numbers = pd.DataFrame({name: table[name].astype(float) for name in _NUMBERS})
    except (OSError, ValueError, KeyError) as error:
        return None, (f"{RESIDUALS} cannot be read: {error}.",)
    return numbers.loc[np.isfinite(numbers.to_numpy()).all(axis=1)], ()
