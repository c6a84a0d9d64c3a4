"""Drive one leg of a return: steer, go, keep to the path, and come to rest at its end."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from agvbench.errors import PlacingError
from agvbench.planning.shortest_paths.return_path import GearLeg, Guided
from agvbench.running.positioning.automatic_return.command_mapping import CommandMapping
from agvbench.running.positioning.automatic_return.motion_interface import MotionInterface
from agvbench.running.positioning.automatic_return.online_adaptation import OnlineAdaptation
from agvbench.running.positioning.automatic_return.path_following import Follower, Guidance
from agvbench.running.positioning.automatic_return.speed_controller import SpeedController


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
        assert pose is not None  # noqa: S101  (a way back begins where the vehicle was seen)
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
                "the vehicle drives the other way than it is told", where=self._motion_interface.where,
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
