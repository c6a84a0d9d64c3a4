"""Frames as a server would stream them, drawn at random."""

from __future__ import annotations

import numpy as np

from agvbench.adapters.natnet.protocol.bitstream import BODY, MARKER, Version
from agvbench.adapters.natnet.protocol.encode import Model
from agvbench.adapters.natnet.protocol.frame import FrameOfData

VERSIONS = [
    Version(*pair) for pair in [(2, 5), (2, 6), (2, 7), (2, 9), (2, 11), (3, 0), (3, 1), (4, 0), (4, 1), (4, 2)]
]


def drawn(bodies: int = 3, markers: int = 5, seed: int = 0) -> tuple[FrameOfData, list[Model]]:
    """Return a frame with bodies 1, 2, … (every third untracked), and their models."""
    rng = np.random.default_rng(seed)
    seen = np.zeros(bodies, BODY)
    seen["id"] = np.arange(1, bodies + 1)
    seen["position_m"], seen["quaternion"] = rng.normal(size=(bodies, 3)), rng.normal(size=(bodies, 4))
    seen["mean_error_m"], seen["flags"] = rng.uniform(0, 1e-3, bodies), np.arange(bodies) % 3 != 2
    labelled = np.zeros(bodies * markers, MARKER)
    labelled["id"] = (np.repeat(seen["id"], markers) << 16) + np.tile(np.arange(1, markers + 1), bodies)
    labelled["position_m"], labelled["size_m"] = rng.normal(size=(bodies * markers, 3)), 0.0125
    labelled["flags"], labelled["residual_m"] = 10, rng.uniform(0, 1e-3, bodies * markers)
    models = [Model(int(i), f"agv{i}", rng.normal(size=(markers, 3)).astype(np.float32)) for i in seen["id"]]
    return FrameOfData(4711, seen, labelled, 12.5, 1_000, 2_000, 3_000, 0), models
