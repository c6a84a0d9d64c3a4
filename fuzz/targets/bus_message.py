"""Every kind of message on the bus, chosen by its type as its receiver would."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from agvbench.errors import MessageError
from agvbench.vehicle.channels import Channels
from fuzz.target import Target


class BusMessage(Target):
    """A message's bytes, decoded as each kind: a receiver trusts nothing that they say, their type included."""

    name = "bus_message"
    instruments = ("agvbench.bus",)

    def __init__(self) -> None:
        from agvbench.bus.messages.codec import decoder
        from agvbench.bus.messages.command import decode_command
        from agvbench.bus.messages.event import Event
        from agvbench.bus.messages.frames import FramesMessage
        from agvbench.bus.messages.identity import decode_agv_identity, decode_mocap_identity
        from agvbench.bus.messages.request import (
            decode_claim,
            decode_replay,
            decode_reset,
            decode_sampling,
            decode_time,
        )
        from agvbench.bus.messages.runner_state import decode_runner_state
        from agvbench.bus.messages.truth import decode_truth

        report: Callable[[bytes], FramesMessage | Event] = decoder(FramesMessage, Event)

        def decode_report(data: bytes) -> object:
            message = report(data)
            return message.frames() if isinstance(message, FramesMessage) else message.as_error()

        self._decoders: tuple[Callable[[bytes], Any], ...] = (
            decode_report, decode_command, decode_reset, decode_sampling, decode_replay, decode_agv_identity,
            decode_mocap_identity, decode_time, decode_claim, decode_truth,
            decode_runner_state,
        )  # fmt: skip

    def seeds(self) -> Iterable[bytes]:
        """Return a message of each kind."""
        from agvbench.bus.messages.codec import encode
        from agvbench.bus.messages.command import CommandMessage
        from agvbench.bus.messages.event import Event, Level
        from agvbench.bus.messages.frames import FramesMessage, pack_columns
        from agvbench.bus.messages.identity import AgvIdentity, MocapIdentity
        from agvbench.bus.messages.request import ClaimMessage, Replay, Reset, Sampling, TimeMessage
        from agvbench.bus.messages.runner_state import Phase, RunnerState, RunProgress, RunResult
        from agvbench.bus.messages.truth import Truth
        from agvbench.types import Command, Commands, Frames, Pose

        numbers = np.arange(3.0)
        frames = Frames(
            numbers, numbers, numbers, numbers, numbers < 2.0, np.arange(3, dtype=np.int64), numbers, numbers
        )
        reset = Reset("run-001", Pose(1.0, 2.0, 0.5), Sampling(240.0, 0.001))
        extra = {"seed": "0", "plant": "agvbench.simulator:make_plant"}
        run = RunProgress(3, 16, "trajectory-5-calibrated-r01", "trajectory", "5", "calibrated", 1, 1, 2.5, 6.8)
        done = (RunResult("trajectory-4-calibrated-r01", "ok", 6.3, -0.2),)
        messages = (
            CommandMessage(1, 0.5, Command(1700.0, 1500.0, 1500.0), 0.1),
            FramesMessage(1, 3, pack_columns(frames)),
            Event(1, "agv", Level.ERROR, "PlantError", "the plant broke", where="plant"),
            reset,
            reset.sampling,
            Replay(reset, Commands(numbers, numbers, numbers, numbers), 3.0),
            AgvIdentity("agv1", "sim", "none", "", Channels.alike("us"), True, True, extra),
            MocapIdentity("sim", 240.0, True, extra),
            TimeMessage(12.5),
            ClaimMessage(7),
            Truth(1, 1, 0.1, numbers, np.zeros((3, 3))),
            RunnerState(
                9,
                7,
                "monday",
                "1.0",
                Phase.DRIVING,
                1.7e9,
                12.5,
                run,
                Pose(1.0, 2.0, 0.5),
                Command(1700.0, 1500.0, 1500.0),
                2,
                1,
                ("agv commands_late: 0.3 s",),
                1,
                done,
            ),
        )
        yield from map(encode, messages)

    def feed(self, data: bytes) -> None:
        """Decode with every decoder; raise what the last said where all refuse."""
        refusals = []
        for decode in self._decoders:
            try:
                decode(data)
            except MessageError as error:
                refusals.append(error)
        for refusal in refusals:
            assert "\n" not in str(refusal)
        if len(refusals) == len(self._decoders):
            raise refusals[-1]
