"""Faults of a camera: what it publishes is wrong, late, or nothing."""

from fault_bench import Campaign
from fault_record import Fault, Then

_LOST = "tracking was lost: not seen for 0.5"

FAULTS = (
    Fault("camera silent", "camera", "no frame comes any more", Then.RETRIES, Campaign(mocap="silent"), _LOST, 0.65),
    Fault(
        "camera untracked",
        "camera",
        "the vehicle is in no frame",
        Then.RETRIES,
        Campaign(mocap="untracked"),
        _LOST,
        0.65,
    ),
    Fault(
        "camera guessed",
        "camera",
        "frames say untracked, and show a plausible pose",
        Then.RETRIES,
        Campaign(mocap="guessed"),
        _LOST,
        0.65,
    ),
    Fault(
        "camera frozen",
        "camera",
        "the same pose again and again",
        Then.STOPS,
        Campaign(mocap="frozen"),
        "tracking is frozen",
        0.7,
    ),
    Fault(
        "bodies swapped",
        "camera",
        "another body's pose, 0.8 m away",
        Then.STOPS,
        Campaign(mocap="swapped"),
        "pose jumped",
        0.25,
    ),
    Fault(
        "camera clock ahead",
        "camera",
        "capture times leap ahead by 2 s",
        Then.STOPS,
        Campaign(mocap="clock_step=2"),
        "camera's clock is ahead",
        0.25,
    ),
    Fault(
        "camera clock back",
        "camera",
        "capture times go back by 0.3 s",
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
        "the vehicle goes faster than its commands say, towards the edge of the floor",
        Then.RETRIES,
        Campaign(agv="faster=4", workspace="circle:1.6", hold_s=4.0, share=0.15),
        "vehicle is leaving the capture volume",
        instead="before the edge",
    ),
)
