"""Whether the left and the right half of appendix B are two measurements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agvbench.types import Floats
from agvbench.workflows.thesis.tables import CorneringTable, cornering_table

PRINTED_STEP_MPS = 0.01


@dataclass(frozen=True)
class MirrorCount:
    """How many of the mirrored pairs (p, 3000 − p) of appendix B carry the same printed speed."""

    pairs: int
    identical: int
    at_rest: int
    differing: tuple[str, ...]

    @property
    def moving(self) -> int:
        """Pairs in which the vehicle moves at all."""
        return self.pairs - self.at_rest


def mirrored(speeds: Floats) -> tuple[Floats, Floats]:
    """Return the left half (pulses below 1500) and its mirror image, each of shape (drive pulses, 3)."""
    half = speeds.shape[1] // 2
    return speeds[:, :half], speeds[:, ::-1][:, :half]


def count_mirrored(table: CorneringTable | None = None) -> MirrorCount:
    """Count identical pairs; speeds are compared as printed."""
    table = table or cornering_table()
    pairs = identical = at_rest = 0
    differing: list[str] = []
    for mode, speeds in table.speed_mps.items():
        left, right = mirrored(speeds)
        same = np.isclose(left, right, atol=0.1 * PRINTED_STEP_MPS)
        pairs += same.size
        identical += int(same.sum())
        at_rest += int(((left == 0.0) & (right == 0.0)).sum())
        differing += [
            f"{table.drive_us[i]:.0f} µs, {mode}, {table.steering_us[j]:.0f}/{3000.0 - table.steering_us[j]:.0f}: "
            f"{left[i, j]:.2f} and {right[i, j]:.2f} m/s"
            for i, j in np.argwhere(~same)
        ]
    return MirrorCount(pairs, identical, at_rest, tuple(differing))


def expected_differing(model_mps: dict[str, Floats], noise_mps: float) -> float:
    """Return how many pairs should differ in print if both halves had been driven.

    `model_mps` is what an asymmetric vehicle would do, per mode like the table; each half adds independent noise of
    standard deviation `noise_mps` before rounding. Summed over all printable values: no random numbers.
    """
    return sum(float(np.sum(1.0 - _same_print(*mirrored(m), noise_mps))) for m in model_mps.values())


def _same_print(left: Floats, right: Floats, noise_mps: float) -> Floats:
    from scipy.stats import norm

    steps = np.arange(-0.02, 0.5, PRINTED_STEP_MPS)[:, None, None]
    left_share, right_share = (
        np.diff(norm.cdf(steps - 0.5 * PRINTED_STEP_MPS, speed, noise_mps), axis=0) for speed in (left, right)
    )
    return np.asarray((left_share * right_share).sum(axis=0))


def straight_speeds_repeated(table: CorneringTable | None = None) -> int:
    """Return for how many drive pulses the three modes print one straight speed (it was driven once, at most)."""
    columns = _straight(table or cornering_table())
    return int(np.sum(np.ptp(columns, axis=1) == 0.0))


def _straight(table: CorneringTable) -> Floats:
    return np.stack([speeds[:, speeds.shape[1] // 2] for speeds in table.speed_mps.values()], axis=1)


def identical_blocks(table: CorneringTable | None = None) -> list[tuple[float, float]]:
    """Return pairs of drive pulses whose 21 printed speeds are all the same and not all zero."""
    table = table or cornering_table()
    blocks = np.concatenate(list(table.speed_mps.values()), axis=1)
    return [
        (float(table.drive_us[i]), float(table.drive_us[j]))
        for i in range(len(blocks))
        for j in range(i + 1, len(blocks))
        if np.array_equal(blocks[i], blocks[j]) and blocks[i].any()
    ]
