"""Information of runs that depend on every parameter."""

from __future__ import annotations

import numpy as np

from agvbench.diagnosis.estimation.likelihood import Information


def every_parameter(forms):
    """Return quadratic forms (R, P, P) as the diagnosis keeps them."""
    return Information(np.tile(np.arange(forms.shape[1]), (len(forms), 1)), forms, forms.shape[1])
