"""Read one recording of any kind as its mapping declares."""

from __future__ import annotations

from pathlib import Path

from agvbench.campaign.recordings.bags.bag import is_bag
from agvbench.campaign.recordings.bags.bag_recording import read_bag_recording
from agvbench.campaign.recordings.csv_recording import read_csv_recording
from agvbench.campaign.recordings.mapping import Mapping
from agvbench.campaign.recordings.recording import Recording
from agvbench.campaign.recordings.tum_recording import read_tum_recording
from agvbench.errors import FileError


def read_recording(path: Path, mapping: Mapping) -> Recording:
    """Read `path`: a bag if the mapping names topics, a TUM file if it has ``[pose]`` without one, else a CSV.

    Raises
    ------
    FileError
        If the file, a mapped column or topic is missing, it is of another kind, or time goes backwards.
    CampaignError
        If a cell is not a number.
    """
    of_bags = mapping.pose is not None and mapping.pose.topic is not None
    if of_bags and not path.exists():
        raise FileError("does not exist", where=path, remedy="give a bag")
    if of_bags != is_bag(path):
        kinds = ("is no ROS bag", "names topics") if of_bags else ("is a ROS bag", "names none of its topics")
        what = f"{kinds[0]}, but the mapping {kinds[1]}"
        raise FileError(what, where=path, remedy="have a mapping guessed (agvbench import --guess)")
    if of_bags:
        return read_bag_recording(path, mapping)
    return read_tum_recording(path, mapping) if mapping.pose else read_csv_recording(path, mapping)
