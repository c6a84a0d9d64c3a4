"""Covariate test: whether the residual depends on a covariate, by smooth curves and a bootstrap over groups."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.data.splits import folds
from agvbench.diagnosis.residuals.body_rates import FEATURES, Rates
from agvbench.types import Floats

RANDOM_PHASE = "distance_modulo_period_m"
DRIFT = "drift"
_PLACE = ("x_m", "y_m")
_SAME_START_M = 0.3
_KNOTS = 6
_PERIODS_M = np.geomspace(0.1, 1.0, 25)
_FLIPS = 4999


@dataclass(frozen=True)
class Dependence:
    """A ``covariate`` on which the ``feature`` of the residual depends.

    ``p_value``: after correction; ``share``: share of the residual's variance that it predicts in runs left out.
    """

    covariate: str
    feature: str
    p_value: float
    share: float


def dependences(
    rates: Rates,
    group: NDArray[np.int64],
    seed: int,
    starts: Floats | None = None,
    *,
    alpha: float = RESIDUAL.dependence_alpha,
) -> list[Dependence]:
    """Return the significant dependences of the residual, the one with the largest share first.

    Each feature is regressed on each covariate by a smooth curve; the drift in the floor frame is regressed on the
    position only. Logged columns are covariates, too: a curve over numbers, or a mean for each level of a text, at the
    steps where there is a value. The score statistic has the group of runs as unit, so that errors within a group may
    be correlated in any way. The share is the variance predicted in groups left out. Distance enters modulo the best of
    several periods.

    The p-value is the share of bootstrap samples in which the largest statistic of all tests is at least as large as
    the observed one (wild bootstrap with random signs of the groups' scores; maximum statistic of Westfall and Young
    1993 against multiple testing). Asymptotic p-values are too small if there are few groups.

    Parameters
    ----------
    rates
        The residual rates of all runs.
    group
        (R,): the group of each run: runs with the same commands.
    seed
        Seed of the random signs and folds.
    starts
        (R, 3): start poses. Repeats from different start poses are separate units in tests of the position.
    alpha
        Level of significance.
    """
    if not len(rates.run):
        return []
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
                strength, bootstrapped = _strength(basis, value, rates.weight, unit)
                np.maximum(most, bootstrapped, out=most)
                if strength > strongest:
                    best, strongest = basis, strength
            if best is not None:
                found.append((label, feature, strongest, _share(best, value, rates.weight, fold)))
    for name, column in rates.logged.items():
        used = np.isfinite(column.value)
        basis = _level_means(column.value[used]) if column.is_text else _basis(column.value[used], name)
        for feature, value in zip(FEATURES, rates.value[used].T, strict=True) if basis.shape[1] else ():
            strength, bootstrapped = _strength(basis, value, rates.weight[used], groups.at(used))
            np.maximum(most, bootstrapped, out=most)
            found.append((name, feature, strength, _share(basis, value, rates.weight[used], fold[used])))
    significant = [
        Dependence(label, feature, p_value, share)
        for label, feature, strength, share in found
        if share > RESIDUAL.min_share and (p_value := float(np.mean(np.r_[most >= strength, True]))) < alpha
    ]
    significant.sort(key=lambda d: -d.share)
    # Drifts along x and along y have one name: the stronger one represents both.
    strongest_first: dict[tuple[str, str], Dependence] = {}
    for d in significant:
        strongest_first.setdefault((d.covariate, d.feature), d)
    return list(strongest_first.values())


@dataclass(frozen=True)
class _Units:
    """Independent units: ``of`` (n,) is the unit of each step, ``signs`` (flips, units) are random signs."""

    of: NDArray[np.int64]
    signs: Floats

    @classmethod
    def drawn(cls, names: NDArray[np.int64], rng: np.random.Generator) -> _Units:
        _, of = np.unique(names, return_inverse=True)
        signs = np.asarray(rng.integers(0, 2, (_FLIPS, int(of.max()) + 1)) * 2 - 1, dtype=np.float64)
        return cls(of, signs)

    def at(self, used: NDArray[np.bool_]) -> _Units:
        """Return the same units for the steps `used` (n,) only."""
        return _Units(self.of[used], self.signs)


def _by_start(group: NDArray[np.int64], starts: Floats) -> NDArray[np.int64]:
    """Return units (R,): a group of runs if all start at the same place, otherwise each of its runs."""
    alone = np.zeros(len(group), dtype=np.bool_)
    for g in np.unique(group):
        own = group == g
        alone[own] = np.ptp(starts[own, :2], axis=0).max() > _SAME_START_M
    return group if not alone.any() else np.where(alone, len(group) + int(group.max()) + np.arange(len(group)), group)


def _features(rates: Rates, covariate: str) -> list[tuple[str, Floats]]:
    """Return the features (n,) that are tested against a covariate, with their names."""
    features = list(zip(FEATURES, rates.value.T, strict=True))
    # A drift towards a place has the same direction for all headings in the floor frame only.
    return features + [(DRIFT, value) for value in rates.drift.T] if covariate in _PLACE else features


def _basis(covariate: Floats, name: str) -> Floats:
    """Return a basis (n, q) without constant: sines for an angle, otherwise hat functions at quantiles."""
    if name in ("heading_rad", "course_rad"):
        return np.column_stack([np.cos(covariate), np.sin(covariate), np.cos(2 * covariate), np.sin(2 * covariate)])
    if not len(covariate):
        return np.empty((0, 0))
    knots = np.unique(np.quantile(covariate, np.linspace(0.0, 1.0, _KNOTS)))
    # Curves between nearly coincident knots would fit noise.
    if len(knots) > 1:
        apart = np.r_[True, np.diff(knots) > 1e-3 * (knots[-1] - knots[0])]
        knots = knots[apart]
    if len(knots) < 2:
        return np.empty((len(covariate), 0))
    hats = np.column_stack([np.interp(covariate, knots, row) for row in np.eye(len(knots))])
    return np.asarray(hats[:, 1:])


def _level_means(level: Floats) -> Floats:
    """Return a basis (n, levels − 1) without constant: whether a step has each level but the first."""
    return np.asarray((level[:, None] == np.unique(level)[None, 1:]).astype(np.float64))


def _waves(distance: Floats, period: float) -> Floats:
    angle = 2.0 * np.pi * distance / period
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _centred(basis: Floats, weight: Floats) -> Floats:
    return np.asarray(basis - np.average(basis, axis=0, weights=weight))


def _strength(basis: Floats, value: Floats, weight: Floats, unit: _Units) -> tuple[float, Floats]:
    """Return the strength of a dependence, −log p by χ², and the strengths (flips,) with random signs of units."""
    centred = value - np.average(value, weights=weight)
    scores = np.zeros((unit.signs.shape[1], basis.shape[1]))
    np.add.at(scores, unit.of, _centred(basis, weight) * (weight * centred)[:, None])
    size, turn = np.linalg.eigh(scores.T @ scores)
    kept = size > 1e-9 * max(size[-1], 1e-300)
    white = scores @ (turn[:, kept] / np.sqrt(size[kept]))
    dof = int(np.count_nonzero(kept))
    return float(_negative_log_p(np.sum(white.sum(axis=0) ** 2), dof)), _negative_log_p(
        np.sum((unit.signs @ white) ** 2, axis=1), dof
    )


def _negative_log_p(square: Floats, dof: int) -> Floats:
    """Return −log p by χ²; ∞ where p underflows."""
    from scipy import special  # not scipy.stats, which takes a second to import

    with np.errstate(divide="ignore"):
        return -np.log(np.asarray(special.chdtrc(dof, square)))


def _share(basis: Floats, value: Floats, weight: Floats, fold: NDArray[np.int64]) -> float:
    """Return the share of the weighted variance that the curve predicts in the folds left out; 0 with a single fold."""
    if len(np.unique(fold)) < 2:
        return 0.0
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
