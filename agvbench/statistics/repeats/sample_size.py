"""How many repeats decide a comparison, from the repeatability that a campaign measured.

Power is that of the comparison itself: a rank-sum test at the corrected level and a difference of medians beyond the
margin for worse, two one-sided tests against the margin for the same. Noise is taken as normal, with the upper 80 %
limit of the measured standard deviation: the plan then keeps its power in four of five campaigns (Browne 1995, On the
use of a pilot sample for sample size determination, Statistics in Medicine 14, 1933–1940).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from agvbench.errors import FlagError, InputError
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM, checked_margins
from agvbench.statistics.differences import ALPHA, ALPHA_SAME
from agvbench.statistics.end_poses import in_order
from agvbench.statistics.hypothesis_tests import critical_pairs
from agvbench.statistics.quantities import END_POSE, Quantity
from agvbench.statistics.run_errors import valid
from agvbench.types import Floats

if TYPE_CHECKING:
    import pandas as pd

POWER = 0.9
WORSE_BY = 2.0
"""A difference that is to be found, in margins: a difference of one margin is in doubt whatever the repeats."""
_ASSURANCE = 0.8
_DRAWS = 1000
_MOST_REPEATS = 200
_MOST_EXACT = 50


@dataclass(frozen=True)
class PlannedRepeats:
    """How many repeats of each side decide one quantity of one trajectory and condition.

    ``sd`` is the standard deviation of the measured ``repeats`` and ``sd_limit`` its upper 80 % limit, in the unit of
    ``quantity``. ``same`` is the number of repeats that show the same within ``margin`` where nothing has changed,
    ``worse`` that which shows worse where the error has grown by twice the margin; None above 200.
    """

    trajectory: str
    condition: str
    quantity: Quantity
    repeats: int
    sd: float
    sd_limit: float
    margin: float
    same: int | None
    worse: int | None


def plan_repeats(
    errors: pd.DataFrame,
    *,
    margin_mm: float = MARGIN_MM,
    margin_deg: float = MARGIN_DEG,
    power: float = POWER,
    alpha: float = ALPHA,
) -> list[PlannedRepeats]:
    """Return how many repeats decide a comparison with a campaign like this one, the largest numbers first.

    Parameters
    ----------
    errors
        What `pose_errors` returns. Only runs that count are used.
    margin_mm, margin_deg
        The noise band of the comparison, of end position and heading error.
    power
        The chance of a verdict.
    alpha
        The chance of any regression where there is none; it is divided by the number of tests.

    Raises
    ------
    InputError
        If no trajectory has two repeats.
    FlagError
        If a margin is not above zero, or the power is not between 0.5 and 0.999.
    """
    margins = checked_margins(margin_mm, margin_deg)
    if not 0.5 <= power <= 0.999:
        raise FlagError("power cannot be used", where="--power", value=power, limit="0.5 to 0.999")
    if not all(margins[quantity] > 0.0 for quantity in END_POSE):
        raise FlagError("a margin of 0 is never shown to be kept", where="--margin-mm", remedy="give margins above 0")
    groups = valid(errors).groupby(["trajectory", "condition"], sort=False)
    cells = {(str(t), str(c)): rows for (t, c), rows in groups if len(rows) > 1}
    if not cells:
        raise InputError("no trajectory has two repeats, so no repeatability", remedy="drive --repeats 5 or more")
    level = alpha / (len(END_POSE) * (len(cells) + (len(cells) > 1)))
    order = in_order(condition for _, condition in cells)
    found = [
        _planned(cell, np.abs(rows[q.column].to_numpy(dtype=float)), q, margins[q], level, power)
        for cell, rows in sorted(cells.items(), key=lambda item: (item[0][0], order.index(item[0][1])))
        for q in END_POSE
    ]
    return sorted(found, key=lambda p: -_number(p))


def _number(planned: PlannedRepeats) -> float:
    return max(math.inf if n is None else n for n in (planned.same, planned.worse))


def _planned(
    cell: tuple[str, str], values: Floats, quantity: Quantity, margin: float, level: float, power: float
) -> PlannedRepeats:
    sd = float(np.std(values, ddof=1))
    limit = sd * math.sqrt((len(values) - 1) / _chi_square_quantile(1.0 - _ASSURANCE, len(values) - 1))
    ratio = round(margin / limit, 2) if limit > 0.0 else math.inf
    same = _fewest(lambda n: power_of_same(n, ratio), power)
    worse = _fewest(lambda n: power_of_worse(n, WORSE_BY * ratio, ratio, level), power)
    return PlannedRepeats(*cell, quantity, len(values), sd, limit, margin, same, worse)


def _chi_square_quantile(probability: float, freedom: int) -> float:
    from scipy.stats import chi2

    return float(chi2.ppf(probability, freedom))


def _fewest(power_at: Callable[[int], float], power: float) -> int | None:
    """Return the smallest number of repeats with this power, by bisection; None above 200."""
    if power_at(_MOST_REPEATS) < power:
        return None
    low, high = 1, _MOST_REPEATS
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power_at(middle) >= power else (middle, high)
    return high


@lru_cache(maxsize=4096)
def power_of_worse(repeats: int, shift: float, margin: float, level: float) -> float:
    """Return the chance of the verdict worse; `shift` and `margin` in standard deviations, `level` corrected."""
    a, b = _drawn(repeats)
    b = b + min(shift, 1e6)
    significant = _pairs(a, b) >= _critical(repeats, level)
    beyond = np.median(b, axis=1) - np.median(a, axis=1) > min(margin, 1e6)
    return float(np.mean(significant & beyond))


@lru_cache(maxsize=4096)
def power_of_same(repeats: int, margin: float) -> float:
    """Return the chance of the verdict same where nothing has changed; `margin` in standard deviations."""
    a, b = _drawn(repeats)
    band, needed = min(margin, 1e6), _critical(repeats, ALPHA_SAME)
    return float(np.mean((_pairs(a, b + band) >= needed) & (_pairs(b, a + band) >= needed)))


@lru_cache(maxsize=64)
def _drawn(repeats: int) -> tuple[Floats, Floats]:
    """Return two samples of normal noise for each draw, shape (draws, repeats)."""
    rng = np.random.default_rng(repeats)
    draws = _DRAWS if repeats <= _MOST_EXACT else _DRAWS // 4
    return rng.standard_normal((draws, repeats)), rng.standard_normal((draws, repeats))


def _pairs(a: Floats, b: Floats) -> Floats:
    """Return in how many pairs b is larger, for each draw: the rank sum of b less its smallest value."""
    n = a.shape[1]
    ranks = np.argsort(np.argsort(np.hstack([a, b]), axis=1), axis=1)[:, n:] + 1
    return np.asarray(ranks.sum(axis=1) - n * (n + 1) / 2, dtype=float)


@lru_cache(maxsize=512)
def _critical(repeats: int, level: float) -> float:
    if repeats <= _MOST_EXACT:
        return critical_pairs(repeats, repeats, level)
    sd = math.sqrt(repeats * repeats * (2 * repeats + 1) / 12.0)
    return repeats * repeats / 2.0 + NormalDist().inv_cdf(1.0 - level) * sd


def plan_in_words(planned: Sequence[PlannedRepeats], power: float = POWER) -> str:
    """Return how many repeats decide every trajectory, as a sentence."""
    worse = max(math.inf if p.worse is None else p.worse for p in planned)
    same = max(math.inf if p.same is None else p.same for p in planned)
    numbers = [f"{n:.0f}" if math.isfinite(n) else f"more than {_MOST_REPEATS}" for n in (worse, same)]
    return (
        f"{numbers[0]} repeats of each side show a growth of {WORSE_BY:g} margins in any one of them, and {numbers[1]} "
        f"that each is the same within its margin, each with a chance of {power:.0%}."
    )
