"""The kinds of executors: one module each, found by `agvbench.executors.registry`."""
