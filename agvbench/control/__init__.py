"""Closed loop: controllers, what they are given and return, and two that follow the path of a plan.

::

    plan, model ─► Reference ─► factory ─► controller ─► Motion or Command
                                (a run)    (each control cycle: pose, time, feed-forward)

`agvbench.running` calls the controller every control cycle and sends what the vehicle model makes of its motion.
"""

from agvbench.control.controller import ControlInput, Controller, ControllerFactory, Demand
from agvbench.control.follower import Approach, PathFollower, Tracking
from agvbench.control.motion import Actuation, Motion
from agvbench.control.pure_pursuit import PurePursuit
from agvbench.control.reference import Reference
from agvbench.control.sections import PathSection, sections_of
from agvbench.control.stanley import Stanley

__all__ = [
    "Actuation",
    "Approach",
    "ControlInput",
    "Controller",
    "ControllerFactory",
    "Demand",
    "Motion",
    "PathFollower",
    "PathSection",
    "PurePursuit",
    "Reference",
    "Stanley",
    "Tracking",
    "sections_of",
]
