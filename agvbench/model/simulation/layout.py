"""Collocation at four Gauss–Legendre nodes, and the layout of the kernel's arrays."""

from __future__ import annotations

import numpy as np

from agvbench.model.simulation.smoothing import SMOOTH_SIZE

# Gauss–Legendre nodes on [0, 1]; ∫₀^c of the polynomial through values at the nodes is the values times
# c (BASIS[j, 0] + c BASIS[j, 1] + …).
COUNT = 4
NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(COUNT)[0]
BASIS = np.linalg.inv(np.vander(NODES, COUNT, increasing=True)).T / np.arange(1.0, COUNT + 1.0)
TO_NODES = np.stack([c * (BASIS @ c ** np.arange(COUNT)) for c in NODES])
WEIGHTS = BASIS.sum(axis=1)

# Work of one step: at the nodes, motion forward, left and turning, then velocity along x, y and turning.
LONGITUDINAL, LATERAL, TURN, ALONG_X, ALONG_Y, TURNED = range(0, 6 * COUNT, COUNT)
SMOOTH = 6 * COUNT
WORK_SIZE = SMOOTH + SMOOTH_SIZE
# Where a step starts: pose, distance driven, the pose that a smoothing camera reports, and the distance with its sign.
START_ROLLED, START_SIZE = 7, 8

# Numbers of the vehicle: axles, the front axle's share of the drive, longest step, when the run began in hours, the
# deviation of the drive's level, and whether it is differential.
FRONT_AXLE, REAR_AXLE, FRONT_DRIVE_SHARE, LONGEST_STEP, STARTED, NODAL_DEVIATION, DIFFERENTIAL = range(7)
SECONDS_PER_HOUR = 3600.0

# How a run begins, after its pose: see `Simulation.predict`.
INITIAL_SPEED, RECENT_SPEED, INITIAL_YAW_RATE, YAW_RATE_WEIGHT, BANDWIDTH, INITIAL_SIZE = range(3, 9)
