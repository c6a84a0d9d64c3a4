"""How far capture times are off, and how far they say they may be, where clocks drift and networks wait.

An emulated server streams at 360 Hz for 60 s to the client that listens to real ones, over UDP on loopback; the time
of both is simulated, so that the truth is known to the last bit. The server's clock drifts; the cameras take 2 ms over
a frame and the network its jitter over a packet, on average, exponentially distributed, each way by itself.
"""

from __future__ import annotations

import argparse
import threading

import numpy as np

from agvbench.adapters.natnet.channel import Connection
from agvbench.adapters.natnet.client import Client, Seen
from agvbench.adapters.natnet.emulator import Emulator, Settings
from agvbench.adapters.natnet.protocol.bitstream import BODY, MARKER
from agvbench.adapters.natnet.protocol.encode import Model
from agvbench.adapters.natnet.protocol.frame import FrameOfData
from agvbench.bus.clock import SimulatedClock
from agvbench.types import Floats

RATE_HZ, CAMERA_S, OFFSET_S = 360.0, 0.002, 12_345.0
DRIFTS = (0.0, 50e-6, -50e-6)
JITTERS_S = (0.0001, 0.001, 0.01)


def connected(server: Emulator, clock: SimulatedClock, seen: list[Seen]) -> Client:
    """Return a client after its handshake; the server answers in a thread for as long as that takes."""
    done = threading.Event()
    thread = threading.Thread(target=lambda: [server.step(0.01) for _ in iter(done.is_set, True)])
    thread.start()
    host, port = server.address
    client = Client(Connection(host, port, host), clock, seen.append)
    done.set()
    thread.join()
    return client


def stream(duration_s: float, drift: float, jitter_s: float) -> tuple[Floats, Floats]:
    """Return errors and stated uncertainties [s] of the capture times of a stream."""
    rng, clock, seen, true_s = np.random.default_rng(0), SimulatedClock(1000.0), [], {}
    server = Emulator(Settings(rate_hz=RATE_HZ, drift=drift, offset_s=OFFSET_S), [Model(1, "a")], clock, threaded=False)
    client = connected(server, clock, seen)
    began_s, bodies = clock.now(), np.zeros(1, BODY)
    for number in range(1, round(duration_s * RATE_HZ) + 1):
        clock.sleep(began_s + number / RATE_HZ - clock.now())
        exposed_s = true_s[number] = clock.now()
        # One thread and one clock for both ends: whatever is due is sent, waits, and arrives.
        client.step(0.0)
        clock.sleep(rng.exponential(jitter_s))
        while server.step():
            pass
        clock.sleep(rng.exponential(jitter_s))
        client.step(0.0)
        clock.sleep(rng.exponential(CAMERA_S))
        ticks = server.ticks(exposed_s)
        server.send(FrameOfData(number, bodies, np.zeros(0, MARKER), exposed_s, ticks, ticks, ticks, 0))
        clock.sleep(rng.exponential(jitter_s))
        client.step(0.0)
    client.close()
    server.close()
    errors = np.array([one.captured.time_s - true_s[one.frame.number] for one in seen])
    return errors, np.array([one.captured.uncertainty_s for one in seen])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="6 s instead of 60 s of stream")
    parser.add_argument("--full", action="store_true", help="the same as without")
    duration_s = 6.0 if parser.parse_args().quick else 60.0
    heads = ("error, median", "worst", "stated, median")
    print(f"{'drift':>9s} {'jitter':>8s} {'frames':>7s} {heads[0]:>14s} {heads[1]:>9s} {heads[2]:>15s}  within")
    for drift in DRIFTS:
        for jitter_s in JITTERS_S:
            errors, bounds = stream(duration_s, drift, jitter_s)
            within = np.abs(errors) <= bounds + 1e-9  # ticks are whole, times are doubles
            print(
                f"{drift * 1e6:5.0f} ppm {jitter_s * 1e3:5.1f} ms {len(errors):7d} "
                f"{np.median(np.abs(errors)) * 1e3:11.3f} ms {np.abs(errors).max() * 1e3:6.2f} ms "
                f"{np.median(bounds) * 1e3:12.3f} ms  {within.mean():.4%}, all: {'yes' if within.all() else 'no'}",
                flush=True,
            )


if __name__ == "__main__":
    main()
