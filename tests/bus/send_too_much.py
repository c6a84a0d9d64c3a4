"""Leaves the bus while a thread sends to receivers that take nothing."""

import sys
import threading
import time

import zenoh

from agvbench.bus.session import bus_session

sent = [time.monotonic()]


def send(session: zenoh.Session) -> None:
    block = zenoh.CongestionControl.BLOCK
    publisher = session.declare_publisher("agvbench/x", congestion_control=block)
    while True:
        publisher.put(bytes(1 << 20))
        sent.append(time.monotonic())


with bus_session(listen=sys.argv[1:]) as session:
    print("listening", flush=True)
    sys.stdin.readline()
    threading.Thread(target=send, args=(session,), daemon=True).start()
    while time.monotonic() - sent[-1] < 1.0:
        time.sleep(0.05)
print("left", flush=True)
