"""What the remaining residual depends on, whatever the cause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.grouping import folds
from agvbench.diagnosis.reading import Readings
from agvbench.types import Floats

FEATURES = ("speed", "sideways", "turning")
ALPHA = 1e-3
"""A dependence is significant below this, corrected for all that were looked at."""

LEAST_SHARE = 0.02
RANDOM_PHASE = "distance_modulo_period_m"
_KNOTS = 6
_STILL_M = 0.01
_PERIODS_M = np.geomspace(0.1, 1.0, 25)
_FLIPS = 4999
_SWINGS_M = np.geomspace(0.15, 1.0, 48)
_SHUFFLES, _LEAST_STEPS, _STEPS_PER_SWING, _LEAST_SWING = 999, 12, 1.6, 0.3
_LOUDEST = 3.0  # times the median run
_SWING_ALPHA = 5e-3  # as many shuffles resolve


@dataclass(frozen=True)
class Dependence:
    """A ``covariate`` that the residual depends on, through ``feature``.

    ``p_value`` after correction; ``share`` of the residual's variance that it predicts in runs left out.
    """

    covariate: str
    feature: str
    p_value: float
    share: float


@dataclass(frozen=True)
class Rates:
    """The residual per metre driven, between successive samples.

    ``run`` (n,) its run; ``value`` (n, 3): share of the distance that is missed along and to the left, and curvature
    missed [1/m]; ``weight`` (n,) metres; ``covariates`` by name (n,); ``begin`` and ``end`` (n, 3) measured poses.
    """

    run: NDArray[np.int64]
    value: Floats
    weight: Floats
    covariates: dict[str, Floats]
    begin: Floats
    end: Floats

    @property
    def middle(self) -> Floats:
        """Where the vehicle was (n, 2)."""
        return np.asarray(0.5 * (self.begin + self.end)[:, :2])


def residual_rates(readings: Readings, poses: Floats) -> Rates:
    """Return how fast measured and predicted motion part, per metre, with what it may depend on.

    Each step of the measurement is compared in the vehicle's own frame at its beginning with the same step of the
    prediction: what went wrong before does not enter.
    """
    measured = np.concatenate([readings.start[:, None], readings.poses], axis=1)
    predicted = np.concatenate([readings.start[:, None], poses], axis=1)
    t_s = np.column_stack([readings.begins_s, readings.t_s])
    # A step goes from one sample that was seen to the next, however many were not between them.
    last = np.maximum.accumulate(np.where(np.isfinite(measured[..., 0]), np.arange(measured.shape[1]), 0), axis=1)
    rows = np.arange(len(measured))[:, None]
    begin, begin_s = measured[rows, last[:, :-1]], t_s[rows, last[:, :-1]]
    steps_m = _body_steps(begin, measured[:, 1:])
    steps_p = _body_steps(predicted[rows, last[:, :-1]], predicted[:, 1:])
    length = np.hypot(steps_p[..., 0], steps_p[..., 1])
    use = np.isfinite(steps_m).all(axis=-1) & (length > _STILL_M)
    run = np.nonzero(use)[0]
    size = length[use]
    direction = np.sign(steps_p[..., 0])[use]
    # By the way driven, forward counted positive: a trim of the axles is the same backward as forward.
    value = (steps_m - steps_p)[use] * (direction / size)[:, None]
    middle = 0.5 * (measured[:, 1:] + begin)[use]
    duration = (t_s[:, 1:] - begin_s)[use]
    driven = (np.cumsum(np.where(use, length, 0.0), axis=1) - 0.5 * length)[use]
    covariates = {
        "x_m": middle[:, 0],
        "y_m": middle[:, 1],
        "heading_rad": np.mod(middle[:, 2], 2.0 * np.pi),
        "time_in_run_s": 0.5 * (t_s[:, 1:] + begin_s)[use],
        "campaign_time_h": readings.started_h[run],
        "speed_mps": size / duration,
        "direction": direction,
        "curvature_per_m": direction * steps_p[..., 2][use] / size,
        "sideslip": direction * steps_p[..., 1][use] / size,
        "distance_m": driven,
    }
    return Rates(run, value, size, covariates, begin[use], measured[:, 1:][use])


def _body_steps(begin: Floats, end: Floats) -> Floats:
    """Return steps (R, K, 3) in the frame half way between the headings at their ends."""
    step = end - begin
    heading = 0.5 * (begin[..., 2] + end[..., 2])
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack(
        [cos * step[..., 0] + sin * step[..., 1], cos * step[..., 1] - sin * step[..., 0], step[..., 2]], -1
    )


def dependences(rates: Rates, group: NDArray[np.int64], seed: int) -> list[Dependence]:
    """Return what the residual significantly depends on, the largest share first.

    For each feature and covariate: least squares on a smooth curve, its score statistic with the group of runs as unit
    (errors within may be correlated as they like), and the share of variance predicted in groups left out.
    Distance enters modulo a period, the best of several. p-values count how often the largest of all
    statistics that were looked at is as large when each group's scores have their sign by chance (wild bootstrap
    by groups; Westfall and Young 1993 for having looked at many): asymptotic ones are too small where groups are few.
    """
    fold = folds(group, 5, seed)[rates.run]
    _, unit = np.unique(group[rates.run], return_inverse=True)
    rng = np.random.default_rng([0x5C0E, seed])
    signs = np.asarray(rng.integers(0, 2, (_FLIPS, int(unit.max()) + 1)) * 2 - 1, dtype=np.float64)
    most = np.full(_FLIPS, -np.inf)
    found: list[tuple[str, str, float, float]] = []
    for name, covariate in rates.covariates.items():
        bases = [_basis(covariate, name)] if name != "distance_m" else [_waves(covariate, p) for p in _PERIODS_M]
        bases = [basis for basis in bases if basis.shape[1]]
        label = name if name != "distance_m" else RANDOM_PHASE
        for k, feature in enumerate(FEATURES):
            value = rates.value[:, k]
            best, strongest = None, -np.inf
            for basis in bases:
                strength, by_chance = _strength(basis, value, rates.weight, unit, signs)
                np.maximum(most, by_chance, out=most)
                if strength > strongest:
                    best, strongest = basis, strength
            if best is not None:
                found.append((label, feature, strongest, _share(best, value, rates.weight, fold)))
    significant = [
        Dependence(label, feature, p_value, share)
        for label, feature, strength, share in found
        if share > LEAST_SHARE and (p_value := float(np.mean(np.r_[most >= strength, True]))) < ALPHA
    ]
    return sorted(significant, key=lambda d: -d.share)


def swing(rates: Rates, group: NDArray[np.int64], seed: int) -> Dependence | None:
    """Return the dependence on the distance modulo a period whose phase differs from run to run, if there is one.

    An eccentric wheel swings speed and course once per turn, from wherever it happens to stand. In each run a wave
    with a phase of its own is fitted to what a straight line leaves; what waves explain of all runs together shows the
    period, and shuffled samples how much of it is chance. Differences of noisy poses swing a little by themselves (a
    tenth), so the share has to be large. What repeats (of one ``group``, (R,)) have in common has no phase of its own,
    whatever its shape, and is taken off before.
    """
    rng = np.random.default_rng([0x5F15, seed])
    counts = np.bincount(rates.run, minlength=len(group))
    repeated = np.bincount(group, weights=counts >= _LEAST_STEPS)[group] > 1
    runs = [rates.run == run for run in np.flatnonzero((counts >= _LEAST_STEPS) & repeated)]
    best: Dependence | None = None
    for feature in ("speed", "turning"):
        value = _of_its_own(rates.value[:, FEATURES.index(feature)], rates.run, group)
        rests = _none_too_loud(
            [_bent(rates.covariates["distance_m"][own], rates.weight[own], value[own]) for own in runs]
        )
        total = sum(float(rest @ rest) for rest, _ in rests)
        if total <= 0.0:
            continue
        size = np.sum([_explained(rest[None, :], waves)[0] for rest, waves in rests], axis=0)
        # A wave takes two numbers of a run's samples whatever they are.
        share = (size - 2.0 * sum(float(rest @ rest) / len(rest) for rest, _ in rests)) / total
        period = int(np.argmax(share))
        if share[period] < max(_LEAST_SWING, best.share if best else 0.0):
            continue
        chance = np.zeros((_SHUFFLES, len(_SWINGS_M)))
        for rest, waves in rests:
            chance += _explained(rng.permuted(np.tile(rest, (_SHUFFLES, 1)), axis=1), waves)
        p_value = (1.0 + float(np.count_nonzero(chance.max(axis=1) >= size[period]))) / (_SHUFFLES + 1.0)
        best = Dependence(RANDOM_PHASE, feature, p_value, float(share[period]))
    return best if best is not None and best.p_value < _SWING_ALPHA else None


def _of_its_own(value: Floats, run: NDArray[np.int64], group: NDArray[np.int64]) -> Floats:
    """Return what each run has (n,) beyond the mean of its group's runs at the same step."""
    first = np.searchsorted(run, run)  # the samples of a run lie together
    _, place = np.unique(np.column_stack([group[run], np.arange(len(run)) - first]), axis=0, return_inverse=True)
    count = np.bincount(place)[place]
    mean = np.bincount(place, weights=value)[place] / count
    return np.where(count > 1, (value - mean) * np.sqrt(count / np.maximum(count - 1, 1)), 0.0)


def _none_too_loud(rests: list[tuple[Floats, Floats]]) -> list[tuple[Floats, Floats]]:
    """Return what is left of the runs, the loudest turned down: a wheel swings in all of them, and not in a few."""
    size = np.array([float(rest @ rest) for rest, _ in rests])
    most = _LOUDEST * float(np.median(size)) if len(size) else 0.0
    return [
        (rest * np.sqrt(most / s) if s > most else rest, waves) for (rest, waves), s in zip(rests, size, strict=True)
    ]


def _bent(distance: Floats, weight: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Return what a straight line leaves of one run, and orthonormal waves (n, 2, periods) of every period.

    Waves of periods that its steps do not resolve are zero.
    """
    line, _ = np.linalg.qr(np.column_stack([weight, weight * distance]))
    rest = weight * value
    angle = 2.0 * np.pi * distance[:, None] / _SWINGS_M
    resolved = _STEPS_PER_SWING * float(np.median(weight)) <= _SWINGS_M
    cosine, sine = (_apart(wave * weight[:, None], line) for wave in (np.cos(angle), np.sin(angle)))
    first = _normal(cosine)
    second = _normal(sine - first * np.sum(first * sine, axis=0))
    return rest - line @ (line.T @ rest), np.stack([first, second], axis=1) * resolved


def _apart(columns: Floats, line: Floats) -> Floats:
    return np.asarray(columns - line @ (line.T @ columns))


def _normal(columns: Floats) -> Floats:
    return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))


def _explained(rows: Floats, waves: Floats) -> Floats:
    """Return what waves of each period explain of each row (rows, periods)."""
    return np.asarray(((rows @ waves[:, 0]) ** 2) + (rows @ waves[:, 1]) ** 2)


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


def _strength(
    basis: Floats, value: Floats, weight: Floats, unit: NDArray[np.int64], signs: Floats
) -> tuple[float, Floats]:
    """Return how strong a dependence is, −log p by χ², and the same for groups' scores with the `signs` given."""
    centred = value - np.average(value, weights=weight)
    scores = np.zeros((signs.shape[1], basis.shape[1]))
    np.add.at(scores, unit, _centred(basis, weight) * (weight * centred)[:, None])
    size, turn = np.linalg.eigh(scores.T @ scores)
    kept = size > 1e-9 * max(size[-1], 1e-300)
    white = scores @ (turn[:, kept] / np.sqrt(size[kept]))
    dof = int(np.count_nonzero(kept))
    return float(_surprise(np.sum(white.sum(axis=0) ** 2), dof)), _surprise(np.sum((signs @ white) ** 2, axis=1), dof)


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
