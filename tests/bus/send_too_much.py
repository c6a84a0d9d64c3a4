"""Leaves the bus while a thread sends to a receiver that takes nothing."""

import sys
import threading
import time
from contextlib import suppress

import zenoh

from agvbench.bus.session import bus_session

sent = [time.monotonic()]


def send(publisher: zenoh.Publisher) -> None:
    # A put after the end of the session is an error of this thread alone.
    with suppress(zenoh.ZError):
        while True:
            publisher.put(bytes(1 << 20))
            sent.append(time.monotonic())


with bus_session(listen=sys.argv[1:]) as session:
    publisher = session.declare_publisher("agvbench/x", congestion_control=zenoh.CongestionControl.BLOCK)
    print("listening", flush=True)
    # The receiver's declaration arrives after the receiver has made it: without it the messages go nowhere, at once.
    while not publisher.matching_status.matching:
        time.sleep(0.01)
    print("matched", flush=True)
    sys.stdin.readline()
    threading.Thread(target=send, args=(publisher,), daemon=True).start()
    while time.monotonic() - sent[-1] < 1.0:
        time.sleep(0.05)
print("left", flush=True)
