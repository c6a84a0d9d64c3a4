"""``reset``: the vehicle's microcontroller is reset, once."""

from __future__ import annotations

import numpy as np

from agvbench.adapters.impairment.faults import SerialLine, VehicleFault


class MicrocontrollerReset(VehicleFault):
    """A drop in voltage when the motor starts, or a press of the reset button."""

    name = "reset"
    needs_line = True

    def begin(self, rng: np.random.Generator) -> None:
        """Not yet."""
        super().begin(rng)
        self._is_done = False

    def inject(self, line: SerialLine | None) -> None:
        """Press the button."""
        assert line is not None  # noqa: S101  (the adapter was asked)
        if not self._is_done:
            line.press_reset()
        self._is_done = True
