"""Faults of the network between camera and host: NatNet packets."""

from fault_bench import Campaign
from fault_record import Fault, Then


def _network(share: str) -> Campaign:
    return Campaign(camera=share)


FAULTS = (
    Fault("packets lost 1 %", "NatNet", "1 % of the packets are lost", Then.GOES_ON, _network("packet_lost=0.01")),
    Fault(
        "packets lost 5 %",
        "NatNet",
        "5 % of the packets are lost",
        Then.GOES_ON,
        _network("packet_lost=0.05"),
        tested=False,
    ),
    Fault(
        "packets lost 50 %",
        "NatNet",
        "half of the packets are lost",
        Then.REJECTS,
        _network("packet_lost=0.5"),
        "no attempt counted: rejected",
        tested=False,
    ),
    Fault(
        "packets reordered",
        "NatNet",
        "5 % of the packets are reordered",
        Then.GOES_ON,
        _network("packet_reordered=0.05"),
    ),
    Fault(
        "packets doubled", "NatNet", "half of the packets arrive twice", Then.GOES_ON, _network("packet_doubled=0.5")
    ),
    Fault("packets cut", "NatNet", "5 % of the packets are truncated", Then.GOES_ON, _network("packet_cut=0.05")),
)
