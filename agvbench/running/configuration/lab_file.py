"""``lab.toml`` of the lab folder: labels of every campaign from here, uncertainties that the lab states, its plant."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from agvbench.campaign.uncertainty_statement import read_statement
from agvbench.errors import FileError
from agvbench.labels import checked_labels
from agvbench.text_files import read_toml
from agvbench.validation import convert

LAB_FILE = "lab.toml"


class _Simulation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    plant: str = ""


class _File(msgspec.Struct, forbid_unknown_fields=True):
    labels: dict[str, Any] = {}
    uncertainty: dict[str, Any] = {}
    simulation: _Simulation = _Simulation()


@dataclass(frozen=True)
class LabFile:
    """What a lab states of itself: ``labels`` by name, ``uncertainty`` as `CampaignHeader` has it.

    ``plant`` is simulated here where no other is named; "" for the usual one.
    """

    labels: Mapping[str, str] = field(default_factory=dict)
    uncertainty: Mapping[str, Any] = field(default_factory=dict)
    plant: str = ""

    @classmethod
    def of_folder(cls) -> LabFile:
        """Return what ``lab.toml`` of the current folder states; nothing where there is none.

        Raises
        ------
        FileError
            As from `load`.
        """
        return cls.load(Path(LAB_FILE)) if Path(LAB_FILE).exists() else cls()

    @classmethod
    def load(cls, path: Path) -> LabFile:
        """Read a file.

        Raises
        ------
        FileError
            If it cannot be read, or has a key or value that cannot be used.
        """
        try:
            file = convert(read_toml(path), _File, where=str(path))
        except OSError as error:
            raise FileError("cannot be read", where=path, value=error.strerror) from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise FileError("is not TOML", where=path, value=error, remedy="correct the line") from None
        labels = checked_labels(file.labels, where=f"{path}: labels", error=FileError)
        return cls(labels, read_statement(file.uncertainty, path, FileError), file.simulation.plant)
