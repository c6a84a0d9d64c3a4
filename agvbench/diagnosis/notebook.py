"""A diagnosis in notebooks: as pandas tables and as HTML."""

from __future__ import annotations

from typing import TYPE_CHECKING

from agvbench.notebook_html import heading_html, table_html

if TYPE_CHECKING:
    import pandas as pd

    from agvbench.diagnosis.result import Diagnosis

_EFFECTS = ("effect", "parameter", "value", "stderr", "unit", "confounded_with")
_STATES = ("effect", "state", "parameter", "lower_bound", "upper_bound", "unit", "indistinguishable_from")
_ERRORS = ("quantity", "before", "after", "floor", "reproducibility")


def effects_frame(found: Diagnosis) -> pd.DataFrame:
    """Return one row per parameter of each effect found; see `Diagnosis.effects_frame`."""
    import pandas as pd

    rows = [
        (effect.name, name, estimate.value, estimate.stderr, estimate.unit, ", ".join(effect.confounded_with))
        for effect in found.effects
        for name, estimate in effect.parameters.items()
    ]
    return pd.DataFrame(rows, columns=list(_EFFECTS))


def states_frame(found: Diagnosis) -> pd.DataFrame:
    """Return one row per effect, and per bounded parameter of absent ones; see `Diagnosis.states_frame`."""
    import pandas as pd

    rows = []
    for name, effect in found.states.items():
        others = ", ".join(effect.indistinguishable_from)
        for parameter, bound in effect.bounds.items():
            low, high = (bound.value, None) if bound.is_limit else (None, bound.value)
            rows.append((name, str(effect.state), parameter, low, high, bound.unit, others))
        if not effect.bounds:
            rows.append((name, str(effect.state), "", None, None, "", others))
    return pd.DataFrame(rows, columns=list(_STATES)).astype({"lower_bound": float, "upper_bound": float})


def errors_frame(found: Diagnosis) -> pd.DataFrame:
    """Return one row per quantity, predicted before and after; see `Diagnosis.errors_frame`."""
    import pandas as pd

    errors = found.held_out.errors if found.held_out else {}
    rows = [(quantity, *(values.get(column) for column in _ERRORS[1:])) for quantity, values in errors.items()]
    return pd.DataFrame(rows, columns=list(_ERRORS)).astype(dict.fromkeys(_ERRORS[1:], float))


def diagnosis_html(found: Diagnosis) -> str:
    """Return verdict and reason, the effects with their parameters, and the prediction errors before and after."""
    depends = ", ".join(dict.fromkeys(d.covariate for d in found.depends_on))
    effects, errors = effects_frame(found), errors_frame(found)
    runs = found.held_out.runs if found.held_out else 0
    return (
        heading_html(str(found.verdict), found.why, f"The residual depends on {depends}." if depends else "")
        + table_html("effects", [name.replace("_", " ") for name in _EFFECTS], effects.itertuples(index=False))
        + table_html(f"prediction errors of {runs} test runs", _ERRORS, errors.itertuples(index=False))
    )
