"""Every kind of message on the bus, chosen by the header as its receiver would."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from agvbench.errors import MessageError
from fuzz.target import Target

_KIND_AT = 5


class BusMessage(Target):
    """A message's bytes."""

    name = "bus_message"
    instruments = ("agvbench.bus",)

    def __init__(self) -> None:
        from agvbench.bus.messages import command as command_message
        from agvbench.bus.messages import event as event_message
        from agvbench.bus.messages import frames as frames_message
        from agvbench.bus.messages import identity as identity_message
        from agvbench.bus.messages import request as request_message
        from agvbench.bus.messages import truth as truth_message
        from agvbench.bus.messages.wire import Kind

        self._decoders: dict[int, Callable[[bytes], Any]] = {
            Kind.COMMAND: command_message.decode_command,
            Kind.FRAMES: lambda data: frames_message.decode_frames(data).frames(),
            Kind.EVENT: lambda data: event_message.decode_event(data).as_error(),
            Kind.RESET: request_message.decode_reset,
            Kind.SAMPLING: request_message.decode_sampling,
            Kind.REPLAY: request_message.decode_replay,
            Kind.AGV_IDENTITY: identity_message.decode_agv_identity,
            Kind.MOCAP_IDENTITY: identity_message.decode_mocap_identity,
            Kind.TIME: request_message.decode_time,
            Kind.TRUTH: truth_message.decode_truth,
        }

    def seeds(self) -> Iterable[bytes]:
        """Return a message of each kind."""
        from agvbench.bus.messages.command import CommandMessage, encode_command
        from agvbench.bus.messages.event import Event, Level, encode_event
        from agvbench.bus.messages.frames import FramesMessage, encode_frames, pack_columns
        from agvbench.bus.messages.identity import (
            AgvIdentity,
            MocapIdentity,
            encode_agv_identity,
            encode_mocap_identity,
        )
        from agvbench.bus.messages.request import (
            Replay,
            Reset,
            Sampling,
            encode_replay,
            encode_reset,
            encode_sampling,
            encode_time,
        )
        from agvbench.bus.messages.truth import Truth, encode_truth
        from agvbench.types import Command, Commands, Frames, Pose

        numbers = np.arange(3.0)
        frames = Frames(
            numbers, numbers, numbers, numbers, numbers < 2.0, np.arange(3, dtype=np.int64), numbers, numbers
        )
        reset = Reset("run-001", Pose(1.0, 2.0, 0.5), Sampling(240.0, 0.001))
        extra = {"seed": "0", "plant": "agvbench.simulator:make_plant"}
        yield encode_command(CommandMessage(1, 0.5, Command(1700.0, 1500.0, 1500.0), 0.1))
        yield encode_frames(FramesMessage(1, pack_columns(frames)))
        yield encode_event(Event(1, "agv", Level.ERROR, "PlantError", "the plant broke"))
        yield encode_reset(reset)
        yield encode_sampling(reset.sampling)
        yield encode_replay(Replay(reset, Commands(numbers, numbers, numbers, numbers), 3.0))
        yield encode_agv_identity(AgvIdentity("agv1", "sim", "none", "", "us", 1500.0, True, True, extra))
        yield encode_mocap_identity(MocapIdentity("sim", 240.0, True, extra))
        yield encode_time(12.5)
        yield encode_truth(Truth(1, 1, 0.1, numbers, np.zeros((3, 3))))

    def feed(self, data: bytes) -> None:
        """Decode with the decoder of the kind that the header says."""
        decoder = self._decoders.get(data[_KIND_AT]) if len(data) > _KIND_AT else None
        if decoder is None:
            raise MessageError("no message of a known kind")
        decoder(data)
