"""What a runner talks to: one vehicle, seen by one motion capture system, over the bus."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from msgspec.structs import replace

from agvbench.bus.clock import Clock, SimulatedClock, WallClock, Watchdog
from agvbench.bus.counters import LossCounter
from agvbench.bus.inbox import Inbox
from agvbench.bus.keys import AGV, CLAIM, IDENTITY, MOCAP, RELEASE, REPLAY, RESET, Keys
from agvbench.bus.liveliness import SETTLES_S, Liveliness
from agvbench.bus.lock_step import LockStep
from agvbench.bus.messages.codec import encode
from agvbench.bus.messages.event import Event, Level
from agvbench.bus.messages.identity import Identity, decode_agv_identity, decode_mocap_identity
from agvbench.bus.messages.request import ClaimMessage, Replay, Reset, Sampling, decode_sampling
from agvbench.bus.outbox import CommandOutbox
from agvbench.bus.queries import ask
from agvbench.bus.real_time import RealTime
from agvbench.bus.state_publisher import LOCK_STEP_PERIOD_S, REAL_TIME_PERIOD_S, StatePublisher, StateSource
from agvbench.errors import AgvbenchError, LinkError
from agvbench.types import Command, Commands, Frames, Pose

_ORIGIN = Pose(0.0, 0.0, 0.0)
_RELEASE_LIMIT_S = 1.0
_ANYWHERE = Sampling(rate_hz=1.0, phase_s=0.0)


class VehicleLink:
    """A runner's end of the bus: commands out, frames in.

    Parameters
    ----------
    session
        An open Zenoh session (`agvbench.bus.session.open_session`); it stays open when the link closes.
    lab, vehicle
        Names on the bus.
    clock
        What the run's time is measured in; by default simulated time if the adapters work in lock step, else
        real time.
    wall
        Real time, in which adapters are waited for.
    calibration_hash
        Of the calibration that the runner drives with: that of the vehicle's adapter unless given. A firmware that was
        built for another is an event.
    answer_limit_s
        How long [s] of `wall` an exchange in lock step, a reset or a replay may take.
    discovery_limit_s
        How long [s] of `wall` to wait for the adapters to turn up.

    Raises
    ------
    AdapterGoneError
        If an adapter does not turn up or does not identify itself.
    LinkError
        If another runner drives this vehicle.
    """

    def __init__(
        self,
        session: Any,
        lab: str,
        vehicle: str,
        clock: Clock | None = None,
        *,
        wall: Clock | None = None,
        calibration_hash: str = "",
        answer_limit_s: float = 60.0,
        discovery_limit_s: float = 5.0,
    ) -> None:
        self.keys = Keys(lab, vehicle)
        self._session, self._wall, self._limit_s = session, wall or WallClock(), answer_limit_s
        self._inbox = Inbox(session, self.keys)
        self._outbox = CommandOutbox(session, self.keys)
        self._liveliness = Liveliness(session, self.keys, self._wall, self._inbox.wake)
        self._watchdog = Watchdog(self._wall, answer_limit_s, self._inbox.wake)
        self._closed = False
        self._token = session.liveliness().declare_token(self.keys.runner(self._outbox.source))
        try:
            self._identity = self._meet(discovery_limit_s)
            self._claim(CLAIM, discovery_limit_s)
            self._compare_calibration(calibration_hash or self._identity.calibration_hash)
        except BaseException:
            self._release()
            raise
        self.clock = clock or (SimulatedClock() if self._identity.lock_step else WallClock())
        self._driver = self._make_driver()

    def _claim(self, queryable: str, limit_s: float) -> None:
        """Claim the vehicle for this runner, or release it: its adapter obeys one runner at a time."""
        self._ask(AGV, queryable, encode(ClaimMessage(self._outbox.source)), limit_s)

    def _ask(self, role: str, queryable: str, payload: bytes, limit_s: float) -> bytes:
        """Return the answer of the adapter in this role; an adapter that vanishes ends the wait."""
        return ask(self._session, self.keys.queryable(role, queryable), payload, limit_s, self._check_liveliness)

    def _check_liveliness(self) -> None:
        self._liveliness.check(AGV, MOCAP, settles_s=SETTLES_S)

    def _compare_calibration(self, driven_with: str) -> None:
        built_for = self._identity.agv.extra.get("firmware_calibration", "none")
        if driven_with and built_for not in ("none", driven_with):
            text = f"the vehicle's firmware was built for calibration {built_for}, the bench drives with {driven_with}"
            self._inbox.events.append(Event(0, AGV, Level.WARNING, "calibration_differs", text))

    def _meet(self, limit_s: float) -> Identity:
        for role in (AGV, MOCAP):
            self._liveliness.wait_for(role, limit_s)
        agv = decode_agv_identity(self._ask(AGV, IDENTITY, b"", limit_s))
        mocap = decode_mocap_identity(self._ask(MOCAP, IDENTITY, b"", limit_s))
        return Identity.of(agv, mocap)

    def _make_driver(self) -> LockStep | RealTime:
        neutral = self._identity.channels.neutral
        if self._identity.lock_step:
            return LockStep(
                self._inbox,
                self._outbox,
                self._liveliness,
                self._watchdog,
                keys=self.keys,
                neutral=neutral,
                clock=self.clock,
            )
        return RealTime(
            self._inbox,
            self._outbox,
            self._liveliness,
            session=self._session,
            keys=self.keys,
            neutral=neutral,
            clock=self.clock,
        )

    def identity(self) -> Identity:
        """Return the identities of vehicle and camera."""
        return self._identity

    def reset(self, pose: Pose, *, run_key: str) -> None:
        """Place a simulated vehicle at rest at `pose`; `run_key` seeds what is random in the run to come.

        Raises
        ------
        LinkError
            If the vehicle is not simulated.
        AdapterGoneError
            If an adapter vanished or does not answer.
        """
        payload = encode(self._prepare(run_key, pose))
        self._ask(AGV, RESET, payload, self._limit_s)
        self._driver.start()

    def control_cycle(self, command: Command, *, t_s: float, hold_s: float) -> Frames:
        """Publish `command` at `t_s` [s] of the run's clock; return the frames that arrive until `t_s` + `hold_s`.

        The run's clock shows 0 at its first command; before, while the vehicle is watched at rest, it is negative.

        Raises
        ------
        AdapterGoneError
            If an adapter vanished or, in lock step, does not answer.
        LinkError
            If frames were lost in lock step, or time goes back.
        PlantError
            If a simulated vehicle broke the plant protocol.
        """
        return self._driver.control_cycle(command, t_s, hold_s)

    def flush(self) -> Frames:
        """Return the frames that were late."""
        return self._driver.flush()

    def stop(self) -> None:
        """Command neutral at once; safe after any failure: on a closed bus it does nothing."""
        if not self._closed:
            with suppress(LinkError):
                self._driver.stop()

    def replay(self, run_key: str, commands: Commands, *, pose: Pose = _ORIGIN, until_s: float | None = None) -> None:
        """Let a simulated vehicle drive a recorded run again, without frames: what wears or drains is as it was.

        Parameters
        ----------
        run_key
            The one that the run was reset with.
        commands
            What was exchanged, beginning with the watch at rest if there was one (negative ``t_s``).
        pose
            The one that the run was reset to.
        until_s
            When the last exchange ended [s]; the last command's ``t_s`` if None.
        """
        reset = self._prepare(run_key, pose)
        if until_s is None:
            until_s = float(commands.t_s[-1]) if len(commands) else 0.0
        payload = encode(Replay(reset, commands, until_s))
        self._ask(AGV, REPLAY, payload, self._limit_s)

    def _prepare(self, run_key: str, pose: Pose) -> Reset:
        """Let the camera begin a run; return the reset that the vehicle is to be sent."""
        if not self._identity.simulated:
            raise LinkError(
                "a real vehicle cannot be placed by software",
                where=self.keys.root,
                remedy="place it by hand, or drive it back",
            )
        self._check_liveliness()
        request = Reset(run_key, pose, _ANYWHERE, self._outbox.source, self._outbox.last)
        answer = self._ask(MOCAP, RESET, encode(request), self._limit_s)
        return replace(request, sampling=decode_sampling(answer))

    def publish_state(self, state: StateSource) -> StatePublisher:
        """Publish the runner's state until the publisher is closed, more seldom where time is simulated."""
        period_s = LOCK_STEP_PERIOD_S if self._identity.lock_step else REAL_TIME_PERIOD_S
        return StatePublisher(self._session, self.keys, self._outbox.source, state, period_s=period_s)

    @property
    def loss(self) -> LossCounter:
        """What was received and lost of the frames messages since the link was opened."""
        return self._inbox.frames_loss

    def take_events(self) -> list[Event]:
        """Return what adapters and link reported since the last call, oldest first, the last thousand at most."""
        return self._inbox.take_events()

    def close(self) -> None:
        """Stop the vehicle and leave the bus; again does nothing."""
        if self._closed:
            return
        self.stop()
        self._closed = True
        with suppress(AgvbenchError):  # an adapter that is gone has released it
            self._claim(RELEASE, _RELEASE_LIMIT_S)
        self._release()
        self._driver.close()

    def _release(self) -> None:
        self._token.undeclare()
        self._watchdog.close()
        self._liveliness.close()
        self._outbox.close()
        self._inbox.close()

    def __enter__(self) -> VehicleLink:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
