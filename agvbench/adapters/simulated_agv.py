"""What AGV adapters in front of a plant share: making it, identifying it, placing it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar, Self

from agvbench.adapters.contract import AdapterOptions, AgvAdapter, AgvReports, run_seed
from agvbench.bus.messages.identity import AgvIdentity
from agvbench.bus.messages.request import Reset, Sampling
from agvbench.simulator import load_plant
from agvbench.types import Plant


class SimulatedAgv(AgvAdapter):
    """A plant behind the bus."""

    lock_step: ClassVar[bool]
    """Whether time passes in the plant only while a command is exchanged."""

    def __init__(self, plant: Plant, options: AdapterOptions) -> None:
        self._plant, self._options = plant, options
        self._neutral = options.channels.neutral
        self._held = self._neutral
        self._sampling: Sampling | None = None
        self._plant_s = math.nan

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> Self:
        """Make the plant that `address`, else the options, name."""
        options = replace(options, plant=address or options.plant)
        return cls(load_plant(options.plant, options.plant_options)(options.seed), options)

    def identity(self) -> AgvIdentity:
        """Return the plant's identity."""
        return AgvIdentity(
            vehicle=self._options.vehicle,
            adapter=self.scheme,
            firmware="simulated",
            calibration_hash=self._options.calibration_hash,
            channels=self._options.channels,
            simulated=True,
            lock_step=self.lock_step,
            extra={"seed": str(self._options.seed), "plant": self._options.plant},
        )

    def start(self, reports: AgvReports) -> None:
        """Keep what shows the camera true poses."""
        self._reports = reports

    def reset(self, request: Reset) -> None:
        """Place the plant at rest, its commands neutral."""
        x_m, y_m, heading_rad = request.pose
        self._plant.reset((x_m, y_m, heading_rad), seed=run_seed(self._options.seed, request.run_key, "plant"))
        self._held, self._sampling = self._neutral, request.sampling
