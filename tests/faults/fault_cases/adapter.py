"""Faults of the adapter of a vehicle."""

from fault_bench import Campaign
from fault_record import Fault, Then

FAULTS = (
    Fault(
        "adapter raises",
        "adapter",
        "the vehicle's adapter raises an unexpected exception",
        Then.STOPS,
        Campaign(agv="fails"),
        "the agv adapter failed: RuntimeError",
        0.1,
    ),
)
