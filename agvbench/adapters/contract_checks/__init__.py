"""Contract checks: whether an adapter, shipped or of a lab, does what its host and the runner rely on.

``agvbench mocap ADAPTER --check`` and ``agvbench agv ADAPTER --check`` print them; the tests of the shipped cameras are
the same checks.
"""

from agvbench.adapters.contract_checks.camera import check_camera
from agvbench.adapters.contract_checks.result import CheckResult
from agvbench.adapters.contract_checks.vehicle import check_vehicle

__all__ = ["CheckResult", "check_camera", "check_vehicle"]
