"""Faults of a camera: what it publishes is wrong, late, or nothing."""

from fault_bench import Campaign
from fault_record import Fault, Then

_LOST = "tracking was lost: not seen for 0.5"

FAULTS = (
    Fault("camera silent", "camera", "no further frame arrives", Then.RETRIES, Campaign(mocap="silent"), _LOST, 0.65),
    Fault(
        "camera untracked",
        "camera",
        "no frame contains the vehicle",
        Then.RETRIES,
        Campaign(mocap="untracked"),
        _LOST,
        0.65,
    ),
    Fault(
        "camera guessed",
        "camera",
        "frames are marked untracked but contain a plausible pose",
        Then.RETRIES,
        Campaign(mocap="guessed"),
        _LOST,
        0.65,
    ),
    Fault(
        "camera frozen",
        "camera",
        "every frame repeats the same pose",
        Then.STOPS,
        Campaign(mocap="frozen"),
        "tracking is frozen",
        0.7,
    ),
    Fault(
        "bodies swapped",
        "camera",
        "frames contain the pose of another body, 0.8 m away",
        Then.STOPS,
        Campaign(mocap="swapped"),
        "pose jumped",
        0.25,
    ),
    Fault(
        "camera clock ahead",
        "camera",
        "capture times jump forward by 2 s",
        Then.STOPS,
        Campaign(mocap="clock_step=2"),
        "camera's clock is ahead",
        0.25,
    ),
    Fault(
        "camera clock back",
        "camera",
        "capture times jump back by 0.3 s",
        Then.STOPS,
        Campaign(mocap="clock_step=-0.3"),
        "camera's clock was set back",
        0.25,
    ),
    Fault("frames 0.1 s late", "camera", "frames arrive 0.1 s late", Then.GOES_ON, Campaign(mocap="late=0.1")),
    Fault(
        "frames 0.6 s late",
        "camera",
        "frames arrive 0.6 s late: a consumer that cannot keep up",
        Then.RETRIES,
        Campaign(mocap="late=0.6"),
        _LOST,
        0.65,
    ),
    Fault("frames lost 1 %", "camera", "1 % of the frames are lost", Then.GOES_ON, Campaign(mocap="lost=0.01")),
    Fault(
        "frames lost 50 %",
        "camera",
        "half of the frames are lost",
        Then.REJECTS,
        Campaign(mocap="lost=0.5"),
        "rejected: tracked share",
    ),
    Fault(
        "leaves the volume",
        "camera",
        "the vehicle is faster than commanded and drives towards the edge of the floor",
        Then.RETRIES,
        Campaign(agv="faster=4", workspace="circle:1.6", hold_s=4.0, share=0.15),
        "vehicle is leaving the capture volume",
        instead="before the edge",
    ),
)
