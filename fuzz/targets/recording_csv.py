"""Foreign recordings: a CSV as a mapping declares it, cut into runs."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fuzz.target import FileTarget

_HEADER = b"safety_value,throttle,steering,vicon time,vicon x,vicon y,vicon yaw\n"


class RecordingCsv(FileTarget):
    """A CSV in the shipped mapping's columns."""

    name = "recording_csv"
    instruments = ("agvbench.campaign",)
    suffix = ".csv"

    def __init__(self) -> None:
        super().__init__()
        from agvbench.campaign.recordings.mapping import load_mapping
        from agvbench.campaign.recordings.reading import read_recording
        from agvbench.campaign.recordings.segmentation import cut

        self._mapping, self._recording, self._cut = load_mapping("dart"), read_recording, cut

    def seeds(self) -> Iterable[bytes]:
        """Return a second of driving, and cells that are empty or no numbers."""
        yield _HEADER + b"".join(b"1,0.2,0.1,%.2f,%.2f,0,0\n" % (number / 50, number / 100) for number in range(40))
        yield _HEADER + b"1,0.2,,0.01,nan,1e308,-inf\n0,,,0.02,0,0,0\n"
        yield _HEADER.replace(b",", b";") + b'"1";"a\nb";;0;0;0;0\n'

    def read(self, path: Path) -> None:
        """Read the rows and cut them."""
        self._cut(self._recording(path, self._mapping), self._mapping.runs)
