"""agvbench: test harness and trajectory benchmark for model AGVs.

``import agvbench`` is for notebooks and scripts, and cheap: what is exported here is imported on first use.

>>> import agvbench
>>> agvbench.Pose(1.0, 2.0, 0.0)
Pose(x_m=1.0, y_m=2.0, heading_rad=0.0)
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agvbench import plot
    from agvbench.calibration import PoseNoise, calibrate, identify
    from agvbench.campaign import Campaign
    from agvbench.diagnosis import Diagnosis, Verdict
    from agvbench.diagnosis.diagnose import diagnose
    from agvbench.errors import AgvbenchError
    from agvbench.model import VehicleModel
    from agvbench.model.rollout import simulate
    from agvbench.model.simulation.simulation import SimulatedRun, Simulation
    from agvbench.planning import Trajectory, plan
    from agvbench.reporting.write import write_report
    from agvbench.statistics import Comparison, pose_errors, valid
    from agvbench.types import Pose, Run
    from agvbench.workflows.comparison.compare import compare
    from agvbench.workflows.history.reading import history
    from agvbench.workflows.history.result import History
    from agvbench.workflows.sweep import sweep

__version__ = "0.2.0"
__all__ = [
    "AgvbenchError",
    "Campaign",
    "Comparison",
    "Diagnosis",
    "History",
    "Pose",
    "PoseNoise",
    "Run",
    "SimulatedRun",
    "Simulation",
    "Trajectory",
    "VehicleModel",
    "Verdict",
    "calibrate",
    "compare",
    "diagnose",
    "history",
    "identify",
    "plan",
    "plot",
    "pose_errors",
    "simulate",
    "sweep",
    "valid",
    "write_report",
]

if not TYPE_CHECKING:  # mypy would take any name for an attribute of a module with __getattr__
    _PACKAGES = {
        "calibration": ("PoseNoise", "calibrate", "identify"),
        "campaign": ("Campaign",),
        "diagnosis": ("Diagnosis", "Verdict", "diagnose"),
        "errors": ("AgvbenchError",),
        "model": ("VehicleModel",),
        "model.rollout": ("simulate",),
        "model.simulation.simulation": ("SimulatedRun", "Simulation"),
        "planning": ("Trajectory", "plan"),
        "reporting.write": ("write_report",),
        "statistics": ("Comparison", "pose_errors", "valid"),
        "types": ("Pose", "Run"),
        "workflows.comparison.compare": ("compare",),
        "workflows.history.reading": ("history",),
        "workflows.history.result": ("History",),
        "workflows.sweep": ("sweep",),
    }
    _HOMES = {name: package for package, names in _PACKAGES.items() for name in names}

    def __getattr__(name):
        """Import what is exported under `name`, and keep it."""
        from importlib import import_module

        if name == "plot":
            return import_module("agvbench.plot")
        if name not in _HOMES:
            raise AttributeError(f"module 'agvbench' has no attribute {name!r}")
        value = getattr(import_module(f"agvbench.{_HOMES[name]}"), name)
        globals()[name] = value
        return value

    def __dir__():
        """Return the names exported, and those of the module."""
        return sorted({*globals(), *__all__})
