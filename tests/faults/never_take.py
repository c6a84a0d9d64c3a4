"""Listens to all messages on the bus, and never takes one: to be killed."""

import sys
import time

import zenoh

from agvbench.bus.session import open_bus_session

with open_bus_session(connect=sys.argv[1:]) as session:
    subscriber = session.declare_subscriber("agvbench/**", zenoh.handlers.FifoChannel(1))
    print("listening", flush=True)
    time.sleep(60.0)
