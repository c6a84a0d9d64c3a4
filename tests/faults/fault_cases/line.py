"""Faults of the serial line and of the firmware behind it."""

from fault_bench import Campaign
from fault_record import Fault, Then

_FIRMWARE = ("simavr",)

FAULTS = (
    Fault(
        "line cut",
        "serial line",
        "the line breaks in the middle of a command; the firmware's watchdog stops the vehicle",
        Then.STOPS,
        Campaign(agv="cut"),
        "the vehicle does not answer any more",
        0.4,
        _FIRMWARE,
    ),
    Fault(
        "bytes corrupt 0.2 %",
        "serial line",
        "0.2 % of the bytes have a wrong bit; commands are sent again",
        Then.GOES_ON,
        Campaign(agv="corrupt=0.002"),
        rigs=_FIRMWARE,
    ),
    Fault(
        "bytes corrupt 20 %",
        "serial line",
        "20 % of the bytes have a wrong bit",
        Then.STOPS,
        Campaign(agv="corrupt=0.2"),
        "see the cable",
        0.6,
        _FIRMWARE,
    ),
    Fault(
        "half lines",
        "serial line",
        "half of the lines arrive without their second half",
        Then.STOPS,
        Campaign(agv="halved=0.5"),
        "see the cable",
        0.8,
        _FIRMWARE,
    ),
    Fault(
        "port gone",
        "serial line",
        "the simulated board and its port disappear",
        Then.STOPS,
        Campaign(agv="unplugged"),
        "has ended",
        0.1,
        _FIRMWARE,
    ),
    Fault(
        "firmware reset",
        "firmware",
        "the microcontroller is reset",
        Then.STOPS,
        Campaign(agv="reset"),
        "the vehicle was reset while it was driven",
        0.2,
        _FIRMWARE,
    ),
)
