"""Drive one leg of a return: steer, go, keep to the path, and come to rest at its end.

With y the distance to the left of the path, e the course's error and d the gear (±1), travel along the path gives
y' = d sin e and e' = d (κ − κ_path). The law κ = κ_path − y/ℓ² − (2/ℓ) d sin e makes y'' + (2/ℓ) y' + y/ℓ² = 0:
errors die off over the length ℓ without overshoot, whichever way the vehicle drives.

References
----------
C. Samson, "Control of chained systems: application to path following and time-varying point-stabilization of mobile
robots", IEEE Transactions on Automatic Control 40 (1995), 64-77.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from agvbench.errors import PlacingError
from agvbench.planning.shortest_paths.return_path import STEP_M, GearLeg, Guided
from agvbench.running.positioning.automatic_return.command_mapping import CommandMapping
from agvbench.running.positioning.automatic_return.motion_interface import MotionInterface
from agvbench.running.positioning.automatic_return.online_adaptation import DriveAdaptation, OnlineAdaptation
from agvbench.types import Pose, wrap_angle


@dataclass(frozen=True)
class ReturnLimits:
    """How near is near enough, and how to drive there.

    A place within ``position_m`` [m] and ``heading_rad`` [rad] will do; what is aimed at is ``reserve`` of it, since a
    camera is noisy. ``fast_mps``, ``mean_mps`` and ``slow_mps`` [m/s] are the speeds of a way, of its last leg and of
    the last ``slow_m`` [m] of that. Errors die off over the way driven at such a speed in ``die_off_s`` [s], since
    servos, cameras and the bus take time. ``astray_m`` [m] off its path a vehicle stops, and another way is found.
    """

    position_m: float = 0.005
    heading_rad: float = math.radians(1.0)
    reserve: float = 0.8
    most_attempts: int = 12
    fast_mps: float = 0.20
    mean_mps: float = 0.14
    slow_mps: float = 0.06
    slow_m: float = 0.12
    steer_first_s: float = 0.5
    look_s: float = 0.5
    settle_limit_s: float = 6.0
    patience_s: float = 20.0
    die_off_s: float = 1.1
    astray_m: float = 0.3


DEFAULT_RETURN = ReturnLimits()


TICK_S = 0.1
_SHORTEST_TICK_S = 0.05
"""Shorter looks hold too few frames for a median."""
_LATE_TICKS = 2
"""Servo and camera show a command about so late."""
_REST_MPS = 0.004
"""In `_REST_TICKS` looks in succession; lower than at the end of a run, since how far it rolled is learnt from it."""
_REST_TICKS = 4
_STUCK_S = 2.0
_WRONG_WAY_MPS = -0.08


class LegDrive:
    """One leg, driven once; `goal_crab_rad` is what it was planned with if it ends at the goal."""

    def __init__(
        self,
        leg: GearLeg,
        motion_interface: MotionInterface,
        command_mapping: CommandMapping,
        online_adaptation: OnlineAdaptation,
        limits: ReturnLimits,
        *,
        goal_crab_rad: float | None,
    ) -> None:
        self._leg, self._motion_interface, self._command_mapping, self._limits = (
            leg,
            motion_interface,
            command_mapping,
            limits,
        )
        self._steering, self._drive = online_adaptation.steering(leg.backward), online_adaptation.drive(leg.backward)
        self._sign, self._is_last = -1.0 if leg.backward else 1.0, goal_crab_rad is not None
        self._fast_mps = limits.mean_mps if self._is_last else limits.fast_mps
        length_m = max(0.5 * command_mapping.model.geometry.wheelbase_m, self._fast_mps * limits.die_off_s)
        self._follower = Follower(leg, length_m, goal_crab_rad=goal_crab_rad)
        self._commanded = 0.0
        self._past: deque[float] = deque([0.0] * _LATE_TICKS, maxlen=_LATE_TICKS)

    def run(self) -> bool:
        """Drive the leg; return whether the vehicle kept to it.

        Raises
        ------
        PlacingError
            If the vehicle does not move, or moves the other way.
        """
        motion_interface = self._motion_interface
        motion_interface.begin()
        self._steering.begin()
        self._steer(self._guide())
        motion_interface.hold(self._command_mapping.command(0.0, self._commanded), self._limits.steer_first_s)
        speed_controller = SpeedController(self._drive, self._fast_mps)
        until_s = motion_interface.now_s + self._limits.patience_s + self._leg.length_m / (0.5 * self._limits.slow_mps)
        tick_s, stuck_s, kept = TICK_S, 0.0, True
        while kept:
            guidance = self._guide()
            tick_s = self._tick(guidance)
            if tick_s == 0.0:
                break
            speed_controller.set_setpoint(self._speed(guidance))
            self._steer(guidance)
            share = speed_controller.step(self._speed_seen, tick_s)
            self._hold(share, tick_s)
            stuck_s = stuck_s + tick_s if share == 1.0 and self._speed_seen < 2.0 * _REST_MPS else 0.0
            self._check(stuck_s)
            kept = abs(guidance.offset_m) < self._limits.astray_m and motion_interface.now_s < until_s
        self._roll_out()
        return kept

    @property
    def _speed_seen(self) -> float:
        return self._sign * self._motion_interface.pose_estimator.speed_mps

    def _guide(self) -> Guidance:
        pose = self._motion_interface.pose_estimator.pose
        assert pose is not None  # noqa: S101  (a return path begins where the vehicle was seen)
        crab_rad = self._steering.crab_rad
        return self._follower.guide(
            Guided(self._command_mapping.model.geometry, self._command_mapping.forward_m, crab_rad).pose(pose), crab_rad
        )

    def _steer(self, guidance: Guidance) -> None:
        self._commanded = self._command_mapping.curvature(self._steering.commanded_for(guidance.curvature_per_m))

    def _speed(self, guidance: Guidance) -> float:
        """Return the speed wanted [m/s]: slow at the end of the last leg, and from a distance that allows for it."""
        brakes_m = self._drive.coast_s * max(0.0, self._speed_seen - self._limits.slow_mps)
        if self._is_last and guidance.left_m < self._limits.slow_m + brakes_m:
            return self._limits.slow_mps
        return self._fast_mps

    def _tick(self, guidance: Guidance) -> float:
        """Return how long to hold the next command [s], so that the stop comes when it should; 0 is now."""
        speed = max(self._speed_seen, 0.02)
        to_stop_s = (guidance.left_m - self._drive.coast_s * max(0.0, self._speed_seen)) / speed
        if to_stop_s >= 1.5 * TICK_S:
            return TICK_S
        if to_stop_s >= TICK_S:
            return 0.5 * to_stop_s
        return max(_SHORTEST_TICK_S, to_stop_s) if to_stop_s > 0.5 * _SHORTEST_TICK_S else 0.0

    def _hold(self, share: float, tick_s: float) -> None:
        late = self._past[0]
        self._past.append(self._commanded)
        self._motion_interface.hold(self._command_mapping.command(self._sign * share, self._commanded), tick_s)
        if self._motion_interface.step is not None:
            self._steering.update(late, self._motion_interface.step, forward_m=self._command_mapping.forward_m)

    def _check(self, stuck_s: float) -> None:
        if stuck_s > _STUCK_S:
            raise PlacingError(
                "the vehicle does not move", where=self._motion_interface.where,
                value=f"full drive for {stuck_s:.0f} s",
                remedy="see to its battery and wheels, then go on with --resume",
            )  # fmt: skip
        if self._speed_seen < _WRONG_WAY_MPS:
            raise PlacingError(
                "the vehicle drives the other way than commanded", where=self._motion_interface.where,
                remedy="give the right file with --vehicle",
            )  # fmt: skip

    def _roll_out(self) -> None:
        """Stop, wait until the vehicle rests, and learn how far it rolled."""
        left_m, speed_mps = self._guide().left_m, self._speed_seen
        until_s, rested = self._motion_interface.now_s + self._limits.settle_limit_s, 0
        while rested < _REST_TICKS and self._motion_interface.now_s < until_s:
            self._motion_interface.hold(self._command_mapping.command(0.0, self._commanded), TICK_S)
            rested = rested + 1 if abs(self._speed_seen) < _REST_MPS else 0
        self._drive.record_coasting(left_m - self._guide().left_m, speed_mps)


_AHEAD_M = 0.3
_LARGEST_OFFSET = 0.7
"""Of ℓ: an offset beyond counts as this, so that a vehicle far off meets its path at some 45° at most."""


@dataclass(frozen=True)
class Guidance:
    """Where a vehicle is on its path: what is left of it, how far left of it [m], and the curvature to drive [1/m]."""

    left_m: float
    offset_m: float
    curvature_per_m: float


class Follower:
    """Follows one leg; `goal_crab_rad` is the crab angle for which its end was planned, if it ends at the goal."""

    def __init__(self, leg: GearLeg, length_m: float, *, goal_crab_rad: float | None = None) -> None:
        self._leg, self._length_m, self._planned = leg, length_m, goal_crab_rad
        self._index = 0

    def guide(self, at: Pose, crab_rad: float) -> Guidance:
        """Return the guidance for a guided point at `at`, course included, of a vehicle that crabs at `crab_rad`."""
        if self._planned is not None:
            at = self._as_planned(at, crab_rad - self._planned)
        points, sign = self._leg.points, -1.0 if self._leg.backward else 1.0
        window = points[self._index : self._index + round(_AHEAD_M / STEP_M)]
        self._index += int(((window[:, 0] - at.x_m) ** 2 + (window[:, 1] - at.y_m) ** 2).argmin())
        x, y, course = points[self._index].tolist()
        c, s = math.cos(course), math.sin(course)
        along = sign * (c * (at.x_m - x) + s * (at.y_m - y))
        offset = c * (at.y_m - y) - s * (at.x_m - x)
        error = wrap_angle(at.heading_rad - course)
        left = self._leg.length_m - float(self._leg.along_m[self._index]) - along
        return Guidance(left, offset, self._curvature(offset, error, sign))

    def _curvature(self, offset_m: float, error_rad: float, sign: float) -> float:
        length = self._length_m
        bounded = min(_LARGEST_OFFSET * length, max(-_LARGEST_OFFSET * length, offset_m))
        path = float(self._leg.curvature_per_m[self._index])
        return path - bounded / length**2 - 2.0 * sign * math.sin(error_rad) / length

    def _as_planned(self, at: Pose, turned_rad: float) -> Pose:
        """Turn about the goal by what was learned of the crab angle since the leg was planned.

        A vehicle that crabs comes to its goal with the right heading on a line that is turned by the crab angle.
        """
        x, y, _ = self._leg.points[-1].tolist()
        c, s = math.cos(turned_rad), -math.sin(turned_rad)
        dx, dy = at.x_m - x, at.y_m - y
        return Pose(x + c * dx - s * dy, y + s * dx + c * dy, at.heading_rad - turned_rad)


_MOVING_MPS = 0.012
_RAMP_PER_S = 0.12
_PATIENCE_S = 0.5
_BANDWIDTH_PER_S = 1.5
_MOST_CHANGE = 0.04


class SpeedController:
    """A ramp until the vehicle moves, then an integral controller whose gain follows from what the share does.

    A drive's slope is not known: speed over the share beyond the one at which it began to move is near enough, and
    errs to the safe side where the drive is steeper further up.
    """

    def __init__(self, adaptation: DriveAdaptation, speed_mps: float) -> None:
        self._adaptation, self._setpoint_mps = adaptation, speed_mps
        self.share = adaptation.initial_share(speed_mps)
        self._moved = False
        self._ramped = False
        self._waited_s = 0.0
        self._steady = 0

    def set_setpoint(self, speed_mps: float) -> None:
        """Change the speed wanted, [m/s] without sign."""
        if speed_mps == self._setpoint_mps:
            return
        onset = min(self._adaptation.onset, self.share)
        prior = onset + (self.share - onset) * speed_mps / self._setpoint_mps
        known = self._adaptation.initial_share(speed_mps)
        self.share = known if known > self._adaptation.onset else prior
        self._setpoint_mps, self._steady = speed_mps, 0

    def step(self, speed_mps: float, dt_s: float) -> float:
        """Return the share to hold next, `speed_mps` [m/s] along the way being what was seen."""
        if speed_mps < _MOVING_MPS:
            self._wait(dt_s)
        else:
            self._regulate(speed_mps, dt_s)
        self.share = min(1.0, max(0.0, self.share))
        return self.share

    def _wait(self, dt_s: float) -> None:
        self._waited_s += dt_s
        if self._waited_s > _PATIENCE_S or self.share == 0.0:
            self.share += _RAMP_PER_S * dt_s
            self._ramped = not self._moved

    def _regulate(self, speed_mps: float, dt_s: float) -> None:
        if not self._moved and self._ramped:
            self._adaptation.onset = max(0.0, self.share - 0.3 * _RAMP_PER_S)
        self._moved, self._waited_s = True, 0.0
        slope = speed_mps / max(self.share - self._adaptation.onset, 0.03)
        change = _BANDWIDTH_PER_S * dt_s * (self._setpoint_mps - speed_mps) / max(slope, 0.1)
        self.share += min(_MOST_CHANGE, max(-_MOST_CHANGE, change))
        near = abs(speed_mps - self._setpoint_mps) < 0.15 * self._setpoint_mps
        self._steady = self._steady + 1 if near else 0
        if self._steady >= 4:
            self._adaptation.record_share(self._setpoint_mps, self.share)
