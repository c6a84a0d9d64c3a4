"""The metrics that ship with agvbench: each module's metrics are found by the registry."""
