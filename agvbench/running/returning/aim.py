"""Where to aim so as to come to a start: what one attempt missed, the next aims off."""

from __future__ import annotations

from agvbench.types import Pose, wrap_angle

_SHARE = 0.5
_FARTHEST_M, _FARTHEST_RAD = 0.03, 0.06
"""What was missed by more says nothing of the next attempt."""
_MOST_IN_A_GEAR = 4


class Aim:
    """The pose to aim at for a start, learned over the attempts of one return.

    What a vehicle misses again and again in one place (a slope, a camera's distortion, a drive that pulls to one side)
    is made up for, whatever its cause; so attempts come in one gear. Where that does not help (a seam in the floor just
    before the start), they come in the other.
    """

    def __init__(self, start: Pose) -> None:
        self._start, self.pose = start, start
        self._backward: bool | None = None
        self._attempts = 0

    @property
    def gears(self) -> tuple[bool, ...]:
        """The gears to come in: backward or not."""
        return (False, True) if self._backward is None else (self._backward,)

    @property
    def is_plain(self) -> bool:
        """Whether the aim is the start itself, in any gear."""
        return self._backward is None and self.pose == self._start

    def begin_anew(self) -> None:
        """Aim at the start itself, in any gear."""
        self.pose, self._backward, self._attempts = self._start, None, 0

    def took(self, backward: bool) -> None:
        """Note the gear of an attempt that was driven to its end."""
        self._backward, self._attempts = backward, self._attempts + 1

    def came_to(self, seen: Pose) -> None:
        """Aim off by a share of what was missed; after some attempts, from the other side."""
        if self._backward is None:
            return
        if self._attempts >= _MOST_IN_A_GEAR:
            self.pose, self._backward, self._attempts = self._start, not self._backward, 0
            return
        missed = seen.relative_to(self._start)
        if max(abs(missed.x_m), abs(missed.y_m)) > _FARTHEST_M or abs(missed.heading_rad) > _FARTHEST_RAD:
            return
        off = self.pose.relative_to(self._start)
        x_m, y_m, heading_rad = (was - _SHARE * now for was, now in zip(off, missed, strict=True))
        self.pose = self._start.compose(Pose(x_m, y_m, wrap_angle(heading_rad)))
