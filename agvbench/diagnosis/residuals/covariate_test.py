"""What the remaining residual depends on, whatever the cause: smooth curves on each covariate, tested by groups."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.splits import folds
from agvbench.diagnosis.residuals.body_rates import FEATURES, Rates
from agvbench.types import Floats

ALPHA = 1e-3
"""A dependence is significant below this, corrected for all that were looked at."""

LIKELY = 0.05
"""Below this it is worth saying where structure is known to remain."""

LEAST_SHARE = 0.02
RANDOM_PHASE = "distance_modulo_period_m"
DRIFT = "drift"
_PLACE = ("x_m", "y_m")
_ELSEWHERE_M = 0.3
_KNOTS = 6
_PERIODS_M = np.geomspace(0.1, 1.0, 25)
_FLIPS = 4999


@dataclass(frozen=True)
class Dependence:
    """A ``covariate`` that the residual depends on, through ``feature``.

    ``p_value`` after correction; ``share`` of the residual's variance that it predicts in runs left out.
    """

    covariate: str
    feature: str
    p_value: float
    share: float


def dependences(
    rates: Rates, group: NDArray[np.int64], seed: int, starts: Floats | None = None, *, alpha: float = ALPHA
) -> list[Dependence]:
    """Return what the residual significantly depends on, the largest share first.

    For each feature and covariate (and for the drift over the floor and the place): least squares on a smooth curve,
    its score statistic with the group of runs as unit (errors within may be correlated as they like), and the share of
    variance predicted in groups left out. Distance enters modulo a period, the best of several. p-values count how
    often the largest of all statistics that were looked at is as large when each group's scores have their sign by
    chance (wild bootstrap by groups; Westfall and Young 1993 for having looked at many): asymptotic ones are too small
    where groups are few.

    Parameters
    ----------
    rates
        Of all runs.
    group
        (R,): of each run, the command that it repeats.
    seed
        Draws signs and folds.
    starts
        (R, 3): where runs began. Repeats that began elsewhere are each evidence of an effect of the place.
    alpha
        Level of significance.
    """
    fold = folds(group, 5, seed)[rates.run]
    rng = np.random.default_rng([0x5C0E, seed])
    groups = _Units.drawn(group[rates.run], rng)
    places = group if starts is None else _by_start(group, starts)
    by_place = groups if places is group else _Units.drawn(places[rates.run], rng)
    most = np.full(_FLIPS, -np.inf)
    found: list[tuple[str, str, float, float]] = []
    for name, covariate in rates.covariates.items():
        bases = [_basis(covariate, name)] if name != "distance_m" else [_waves(covariate, p) for p in _PERIODS_M]
        bases = [basis for basis in bases if basis.shape[1]]
        label = name if name != "distance_m" else RANDOM_PHASE
        unit = by_place if name in _PLACE else groups
        for feature, value in _features(rates, name):
            best, strongest = None, -np.inf
            for basis in bases:
                strength, by_chance = _strength(basis, value, rates.weight, unit)
                np.maximum(most, by_chance, out=most)
                if strength > strongest:
                    best, strongest = basis, strength
            if best is not None:
                found.append((label, feature, strongest, _share(best, value, rates.weight, fold)))
    significant = [
        Dependence(label, feature, p_value, share)
        for label, feature, strength, share in found
        if share > LEAST_SHARE and (p_value := float(np.mean(np.r_[most >= strength, True]))) < alpha
    ]
    significant.sort(key=lambda d: -d.share)
    # Along x and along y drifts have one name: the stronger stands for both.
    strongest_first: dict[tuple[str, str], Dependence] = {}
    for d in significant:
        strongest_first.setdefault((d.covariate, d.feature), d)
    return list(strongest_first.values())


@dataclass(frozen=True)
class _Units:
    """What is independent: ``of`` each sample (n,) its unit, and random ``signs`` of the units (flips, units)."""

    of: NDArray[np.int64]
    signs: Floats

    @classmethod
    def drawn(cls, names: NDArray[np.int64], rng: np.random.Generator) -> _Units:
        _, of = np.unique(names, return_inverse=True)
        signs = np.asarray(rng.integers(0, 2, (_FLIPS, int(of.max()) + 1)) * 2 - 1, dtype=np.float64)
        return cls(of, signs)


def _by_start(group: NDArray[np.int64], starts: Floats) -> NDArray[np.int64]:
    """Return units (R,): the runs of a group together where they began alike, else each by itself."""
    alone = np.zeros(len(group), dtype=np.bool_)
    for g in np.unique(group):
        own = group == g
        alone[own] = np.ptp(starts[own, :2], axis=0).max() > _ELSEWHERE_M
    return group if not alone.any() else np.where(alone, len(group) + int(group.max()) + np.arange(len(group)), group)


def _features(rates: Rates, covariate: str) -> list[tuple[str, Floats]]:
    """Return what may depend on a covariate, (n,) each, by its name."""
    features = list(zip(FEATURES, rates.value.T, strict=True))
    # What pulls a vehicle towards a place moves it aside one way and back the other: only over the floor it is the
    # same for all.
    return features + [(DRIFT, value) for value in rates.drift.T] if covariate in _PLACE else features


def _basis(covariate: Floats, name: str) -> Floats:
    """Return a smooth curve's basis (n, q) without a constant: sines for an angle, else hats on quantiles."""
    if name == "heading_rad":
        return np.column_stack([np.cos(covariate), np.sin(covariate), np.cos(2 * covariate), np.sin(2 * covariate)])
    knots = np.unique(np.quantile(covariate, np.linspace(0.0, 1.0, _KNOTS)))
    # Knots that nearly coincide would make curves out of noise.
    if len(knots) > 1:
        apart = np.r_[True, np.diff(knots) > 1e-3 * (knots[-1] - knots[0])]
        knots = knots[apart]
    if len(knots) < 2:
        return np.empty((len(covariate), 0))
    hats = np.column_stack([np.interp(covariate, knots, row) for row in np.eye(len(knots))])
    return np.asarray(hats[:, 1:])


def _waves(distance: Floats, period: float) -> Floats:
    angle = 2.0 * np.pi * distance / period
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _centred(basis: Floats, weight: Floats) -> Floats:
    return np.asarray(basis - np.average(basis, axis=0, weights=weight))


def _strength(basis: Floats, value: Floats, weight: Floats, unit: _Units) -> tuple[float, Floats]:
    """Return how strong a dependence is, −log p by χ², and the same for units' scores with signs by chance."""
    centred = value - np.average(value, weights=weight)
    scores = np.zeros((unit.signs.shape[1], basis.shape[1]))
    np.add.at(scores, unit.of, _centred(basis, weight) * (weight * centred)[:, None])
    size, turn = np.linalg.eigh(scores.T @ scores)
    kept = size > 1e-9 * max(size[-1], 1e-300)
    white = scores @ (turn[:, kept] / np.sqrt(size[kept]))
    dof = int(np.count_nonzero(kept))
    return float(_surprise(np.sum(white.sum(axis=0) ** 2), dof)), _surprise(
        np.sum((unit.signs @ white) ** 2, axis=1), dof
    )


def _surprise(square: Floats, dof: int) -> Floats:
    """Return −log p by χ²; ∞ where p is too small for a number."""
    from scipy import special  # not scipy.stats, which takes a second to import

    with np.errstate(divide="ignore"):
        return -np.log(np.asarray(special.chdtrc(dof, square)))


def _share(basis: Floats, value: Floats, weight: Floats, fold: NDArray[np.int64]) -> float:
    """Return the share of the weighted variance that the curve predicts in the folds left out."""
    full = np.column_stack([np.ones(len(value)), basis])
    error = total = 0.0
    for k in np.unique(fold):
        out = fold == k
        w = weight[~out]
        matrix = full[~out].T @ (full[~out] * w[:, None])
        coefficient = np.linalg.lstsq(matrix, full[~out].T @ (w * value[~out]), rcond=1e-8)[0]
        mean = np.average(value[~out], weights=w)
        error += float(np.sum(weight[out] * (value[out] - full[out] @ coefficient) ** 2))
        total += float(np.sum(weight[out] * (value[out] - mean) ** 2))
    return 1.0 - error / total if total > 0.0 else 0.0
