"""What decoding a NatNet frame costs beside another client on the same bytes, and whether a stream arrives whole.

The frame has 25 rigid bodies of five markers, version 4.1. The peer (natnet 0.3) always decodes all that is there, so
it gets the frame with markers where markers are wanted, and one with bodies only where bodies are wanted; ours is
timed on the same bytes, and on the frame with markers when only bodies are wanted, too. The other peer (optirx 1.9)
ends with version 2.10: both are timed on 2.9, where ours walks through every section, since none says its size. Ours
and the peer take turns in blocks; the ratio is the median of the blocks' ratios.

The stream comes from another process at 360 Hz over UDP on loopback, by default for 10 s (``--full``: 60 s).
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

import natnet.data_frame
import natnet.packet_buffer
import natnet.version
import numpy as np
import optirx

from agvbench.adapters.natnet.channel import Connection
from agvbench.adapters.natnet.client import Client, Seen
from agvbench.adapters.natnet.emulator import Emulator, Settings
from agvbench.adapters.natnet.protocol.bitstream import BODY, MARKER, Version
from agvbench.adapters.natnet.protocol.encode import Model, encode_frame
from agvbench.adapters.natnet.protocol.frame import FrameOfData, decode_frame
from agvbench.adapters.natnet.protocol.packet import Message, join
from agvbench.bus.clock import WallClock

BODIES, MARKERS, RATE_HZ = 25, 5, 360.0
VERSION, OLD = Version(4, 1), Version(2, 9)
BOUND = 10.0
BLOCKS, TIMES = 15, 200


def example(markers: int) -> tuple[FrameOfData, list[Model]]:
    """Return a frame and its models."""
    rng = np.random.default_rng(0)
    bodies, labelled = np.zeros(BODIES, BODY), np.zeros(BODIES * markers, MARKER)
    bodies["id"], bodies["flags"] = np.arange(1, BODIES + 1), 1
    bodies["position_m"], bodies["quaternion"] = rng.normal(size=(BODIES, 3)), rng.normal(size=(BODIES, 4))
    labelled["id"] = (np.repeat(bodies["id"], markers) << 16) + np.tile(np.arange(1, markers + 1), BODIES)
    labelled["position_m"] = rng.normal(size=(BODIES * markers, 3))
    models = [Model(int(i), f"agv{i}", np.zeros((markers, 3), np.float32)) for i in bodies["id"]]
    return FrameOfData(1, bodies, labelled, 1.0, 0, 0, 0, 0), models if markers else []


def seconds(call: Callable[[], object]) -> float:
    """Return the time of a call, over many."""
    began = time.perf_counter()
    for _ in range(TIMES):
        call()
    return (time.perf_counter() - began) / TIMES


def compare(what: str, ours: Callable[[], object], peer: Callable[[], object]) -> None:
    """Print a row."""
    blocks = [(seconds(ours), seconds(peer)) for _ in range(BLOCKS)]
    own, other = (statistics.median(column) * 1e6 for column in zip(*blocks, strict=True))
    ratio = statistics.median(theirs / mine for mine, theirs in blocks)
    verdict = "yes" if ratio >= BOUND else "no"
    print(f"{what:52s} {own:8.1f} µs {other:8.1f} µs {ratio:6.1f}  ≥ {BOUND:g}  {verdict}", flush=True)


def decoding() -> None:
    """Print what decoding costs."""
    wanted = natnet.version.Version(*VERSION)

    def peer(payload: bytes) -> Callable[[], object]:
        return lambda: natnet.data_frame.DataFrame.read_from_buffer(natnet.packet_buffer.PacketBuffer(payload), wanted)

    full, bare = encode_frame(*_swap(example(MARKERS))), encode_frame(*_swap(example(0)))
    print(f"{'25 bodies, version 4.1 (but for the last two)':52s} {'ours':>11s} {'peer':>11s}  ratio  bound met?")
    compare("markers wanted", lambda: decode_frame(full, VERSION, markers=True), peer(full))
    compare("bodies wanted, frame of bodies only", lambda: decode_frame(bare, VERSION), peer(bare))
    compare("bodies wanted, frame with markers (peer reads all)", lambda: decode_frame(full, VERSION), peer(full))
    old_decoding()


def old_decoding() -> None:
    """Print what decoding costs in a version that both peers read."""
    wanted, markers = natnet.version.Version(*OLD), example(MARKERS)
    payload = encode_frame(markers[0], OLD, markers[1])
    packet = join(Message.FRAMEOFDATA, payload)

    def peer() -> object:
        return natnet.data_frame.DataFrame.read_from_buffer(natnet.packet_buffer.PacketBuffer(payload), wanted)

    compare("2.9, markers wanted, beside natnet", lambda: decode_frame(payload, OLD, markers=True), peer)
    compare(
        "2.9, markers wanted, beside optirx",
        lambda: decode_frame(payload, OLD, markers=True),
        lambda: optirx.unpack(packet, (*OLD, 0, 0)),
    )


def _swap(made: tuple[FrameOfData, list[Model]]) -> tuple[FrameOfData, Version, list[Model]]:
    return made[0], VERSION, made[1]


def stream(duration_s: float) -> None:
    """Publish for a while; the other end of `streaming`."""
    frame, models = example(MARKERS)
    server = Emulator(Settings(rate_hz=RATE_HZ), models)
    print(server.address[1], flush=True)
    sys.stdin.readline()
    began, count = time.perf_counter(), round(duration_s * RATE_HZ)
    for number in range(1, count + 1):
        time.sleep(max(0.0, began + number / RATE_HZ - time.perf_counter()))
        server.send(frame._replace(number=number, exposed_ticks=server.ticks()))
    print(count, time.perf_counter() - began, flush=True)
    sys.stdin.readline()
    server.close()


def streaming(duration_s: float) -> None:
    """Print what arrived of a stream."""
    process = subprocess.Popen(  # noqa: S603
        [sys.executable, __file__, "--stream", str(duration_s)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    delays: list[float] = []

    def seen(one: Seen) -> None:
        delays.append(one.received_s - one.captured.time_s)

    client = Client(Connection("127.0.0.1", int(process.stdout.readline())), WallClock(), seen)
    client.start()
    print(file=process.stdin, flush=True)
    sent, taken_s = process.stdout.readline().split()
    time.sleep(0.2)
    print(file=process.stdin, flush=True)
    counters = client.counters
    client.close()
    process.wait()
    met = "yes" if len(delays) == int(sent) else "no"
    rate_hz = int(sent) / float(taken_s)
    print(
        f"25 bodies × 5 markers at {rate_hz:.0f} Hz for {float(taken_s):.0f} s: {len(delays)} of {sent} frames, "
        f"{counters.lost} lost, {counters.malformed} malformed; exposure to receipt "
        f"{statistics.median(delays) * 1e3:.2f} ms (median); none lost: {met}"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="stream for 60 s")
    parser.add_argument("--quick", action="store_true", help="stream for 2 s")
    parser.add_argument("--stream", type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.stream is not None:
        stream(arguments.stream)
        return
    decoding()
    streaming(60.0 if arguments.full else 2.0 if arguments.quick else 10.0)


if __name__ == "__main__":
    main()
