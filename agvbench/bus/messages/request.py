"""Requests to adapters that are not commands, and their replies: claim, reset, sampling, replay, time."""

from __future__ import annotations

import math

import numpy as np

from agvbench.bus.messages.codec import MAX_ROWS, Message, Number, Source, Text, decoder
from agvbench.errors import MessageError
from agvbench.types import Commands, Pose


class ClaimMessage(Message, tag="claim", frozen=True):
    """The runner whose commands are of ``source`` claims a vehicle, or releases it."""

    source: Source


class TimeMessage(Message, tag="time", frozen=True):
    """A clock's reading."""

    now_s: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.now_s):
            raise MessageError("time is not finite", value=self.now_s)


class Sampling(Message, tag="sampling", frozen=True):
    """When a camera looks: at ``phase_s + k / rate_hz`` [s] in the run's clock, for every integer k."""

    rate_hz: float
    phase_s: float

    def __post_init__(self) -> None:
        if not (0.0 < self.rate_hz < math.inf and math.isfinite(self.phase_s)):
            value = f"{self.rate_hz} Hz, {self.phase_s} s"
            raise MessageError("sampling is out of range", value=value, limit="above 0 Hz, finite")


class Reset(Message, tag="reset", frozen=True):
    """Place a simulated vehicle at rest at `pose`; ``run_key`` seeds all that is random in the run to come.

    Commands from ``source`` up to number ``after`` belong to what was before: a host that finds one still waiting
    drops it.
    """

    run_key: Text
    pose: Pose
    sampling: Sampling
    source: Source = 0
    after: Number = 0

    def __post_init__(self) -> None:
        if not self.pose.is_finite:
            raise MessageError("pose to reset to is not finite", where=self.run_key, value=tuple(self.pose))


class Replay(Message, tag="replay", frozen=True):
    """Drive a recorded run again, without frames, until ``until_s`` [s] in its clock."""

    reset: Reset
    commands: Commands
    until_s: float

    def __post_init__(self) -> None:
        key, commands = self.reset.run_key, self.commands
        columns = (commands.t_s, commands.drive, commands.front, commands.rear)
        counts = [column.size for column in columns]
        if counts[0] > MAX_ROWS:
            raise MessageError("too many commands to replay", where=key, value=counts[0], limit=f"at most {MAX_ROWS}")
        if len(set(counts)) > 1:
            raise MessageError("columns of commands to replay differ in length", where=key, value=counts)
        if not (math.isfinite(self.until_s) and all(np.isfinite(column).all() for column in columns)):
            raise MessageError("commands to replay are not finite", where=key)
        if (np.diff(commands.t_s) <= 0.0).any():
            raise MessageError("commands to replay go back in time", where=key)


decode_claim = decoder(ClaimMessage)
decode_time = decoder(TimeMessage)
decode_sampling = decoder(Sampling)
decode_reset = decoder(Reset)
decode_replay = decoder(Replay)
