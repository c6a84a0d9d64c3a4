"""End-pose bias: what a corrected model is known to miss at the end of trajectories driven before."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from agvbench.errors import FileError
from agvbench.text_files import read_json
from agvbench.types import Pose

NO_BIAS_CORRECTIONS: Mapping[str, Pose] = MappingProxyType({})
_KEYS = ("x_m", "y_m", "heading_rad")


def read_bias_corrections(path: str) -> Mapping[str, Pose]:
    """Return, by trajectory, the measured end pose in the frame of the predicted one; nothing for the path "".

    The file is JSON: ``{"schema": 1, "remainders": {"5": {"x_m": 0.004, "y_m": 0.0, "heading_rad": 0.01}}}``.

    Raises
    ------
    FileError
        If the file cannot be read, or is not of this form.
    """
    if not path:
        return NO_BIAS_CORRECTIONS
    try:
        content = read_json(Path(path))
        made = {str(name): Pose(*(float(entry[key]) for key in _KEYS)) for name, entry in content["remainders"].items()}
    except OSError as error:
        raise FileError("cannot be read", where=path, value=error.strerror) from None
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise FileError("not a file of remainders", where=path, value=error, remedy="agvbench loop writes it") from None
    for name, pose in made.items():
        if not pose.is_finite:
            raise FileError("is not finite", where=f"{path}: {name}", value=tuple(pose))
    return made
