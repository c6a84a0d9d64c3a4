"""Is a bias small against the repeatability? An equivalence test, not a test that fails to find one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from agvbench.statistics.quantities import COMPONENTS, Quantity
from agvbench.statistics.run_errors import valid
from agvbench.types import Floats

if TYPE_CHECKING:
    import pandas as pd

LEVEL = 0.05
FEWEST = 3


class Bias(StrEnum):
    """What repeats say about a bias and a margin."""

    WITHIN = "within"
    BEYOND = "beyond"
    INCONCLUSIVE = "cannot say"


@dataclass(frozen=True)
class Equivalence:
    """A bias beside the repeatability.

    ``bias`` is the mean with its ``stderr``, ``sd`` the standard deviation of one repeat. ``p_within`` is the chance to
    see so small a bias if the true one were ``margin_sds`` standard deviations, ``p_beyond`` to see so large a one.
    """

    repeats: int
    bias: float
    sd: float
    margin_sds: float
    p_within: float
    p_beyond: float

    @property
    def stderr(self) -> float:
        """Standard error of the bias."""
        return self.sd / math.sqrt(self.repeats) if self.repeats else math.nan

    @property
    def verdict(self) -> Bias:
        """Within the margin or beyond it at the 5 % level, or neither."""
        if self.p_within < LEVEL:
            return Bias.WITHIN
        return Bias.BEYOND if self.p_beyond < LEVEL else Bias.INCONCLUSIVE


def equivalence(values: Floats, *, margin_sds: float = 1.0) -> Equivalence:
    """Test whether the mean of `values`, shape (n,), is within ± `margin_sds` standard deviations of zero.

    Two one-sided tests (Schuirmann 1987). The margin is a multiple of a standard deviation that is itself estimated, so
    their statistic follows Student's noncentral distribution (Wellek 2010, section 5.3); taking the estimate for the
    truth would accept too often. Fewer than three values say nothing.

    Examples
    --------
    >>> str(equivalence(np.array([1.0, -2.0, 0.5, 2.0, -1.5] * 6)).verdict)
    'within'
    >>> str(equivalence(np.array([4.0, 5.0, 6.0, 5.5, 4.5])).verdict)
    'beyond'
    """
    n = len(values)
    if n < FEWEST or not np.isfinite(values).all():
        return Equivalence(n, float(np.mean(values)) if n else math.nan, math.nan, margin_sds, 1.0, 1.0)
    bias, sd = float(np.mean(values)), float(np.std(values, ddof=1))
    if sd == 0.0:
        return Equivalence(n, bias, sd, margin_sds, float(bias != 0.0), float(bias == 0.0))
    from scipy.stats import nct

    statistic, away = math.sqrt(n) * abs(bias) / sd, math.sqrt(n) * margin_sds
    within = float(nct.cdf(statistic, n - 1, away))
    return Equivalence(n, bias, sd, margin_sds, within, 1.0 - within)


def equivalences(
    errors: pd.DataFrame, condition: str, quantities: Sequence[Quantity] = COMPONENTS
) -> dict[tuple[str, str], Equivalence]:
    """Return the test of each signed error of every trajectory under `condition`, within ± 1 standard deviation.

    Parameters
    ----------
    errors
        What `pose_errors` returns.
    condition
        Whose runs count.
    quantities
        Which errors: along, across and heading by default.

    Returns
    -------
    dict
        By trajectory and the quantity's column (``"along_mm"``, …); units of the column.
    """
    counted = valid(errors)
    counted = counted[counted["condition"] == condition]
    return {
        (str(name), quantity.column): equivalence(rows[quantity.column].to_numpy(dtype=float))
        for name, rows in counted.groupby("trajectory", sort=False)
        for quantity in quantities
    }
