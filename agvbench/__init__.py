"""agvbench: test harness and trajectory benchmark for model AGVs.

Importing the package is cheap on purpose: heavy libraries are imported by the modules that use them.
"""

__version__ = "0.2.0"
