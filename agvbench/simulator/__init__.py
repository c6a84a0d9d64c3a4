"""Plants and sensor noise: an independent truth that shares no code with the vehicle model."""

from agvbench.simulator.plants import make_plant, random_plant, small_plant

__all__ = ["make_plant", "random_plant", "small_plant"]
