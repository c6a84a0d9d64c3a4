"""The result file of a challenge: scores and every trial, written after each trial and read again to go on."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from agvbench.challenge.scores import plain, score
from agvbench.challenge.trial import Trial
from agvbench.errors import FileError
from agvbench.text_files import read_json
from agvbench.workflows.output_files import write_file

SCHEMA = 1


def write_trials(path: Path, repeats: int, trials: Sequence[Trial]) -> None:
    """Write scores and trials, in the order of what was hidden; the file is replaced at once or not at all.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    ordered = sorted(trials, key=lambda trial: (trial.spec, trial.seed))
    scores = _without_empty(score(ordered).to_json(), "errors")
    content: dict[str, Any] = {"schema": SCHEMA, "repeats": repeats, **scores}
    content["each"] = [_without_empty(plain(asdict(trial)), "error") for trial in ordered]
    text = json.dumps(content, indent=1) + "\n"
    write_file("--json", path, lambda file: file.write_text(text, encoding="utf-8"))


def known_trials(path: Path, repeats: int) -> dict[tuple[str, int], Trial]:
    """Return the trials that a file holds, by what was hidden and seed.

    Raises
    ------
    FileError
        If it cannot be read, is no such file, or was made with other `repeats`.
    """
    import msgspec

    try:
        content = read_json(path)
        found = msgspec.convert(_with_nan(content["each"]), list[Trial])
        was = content["repeats"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileError(
            "holds no challenge to go on with", where=path, value=str(error).splitlines()[0],
            remedy="leave out --resume to begin anew",
        ) from None  # fmt: skip
    if was != repeats:
        raise FileError("has trials with other repeats", where=path, value=was, limit=f"--repeats {repeats}")
    return {(trial.spec, trial.seed): trial for trial in found}


def _without_empty(content: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in content.items() if name != key or value}


def _with_nan(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _with_nan(value) for key, value in content.items()}
    if isinstance(content, list):
        return [_with_nan(value) for value in content]
    return math.nan if content is None else content
