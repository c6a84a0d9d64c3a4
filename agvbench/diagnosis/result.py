"""The result of a diagnosis, and its JSON (schema 1)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from agvbench.diagnosis.proposal import NextExperiment
from agvbench.diagnosis.residuals.covariate_test import Dependence
from agvbench.effects import effect_kinds
from agvbench.model import VehicleModel

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = 1
_FIRST = ("end_position_mm", "end_position_median_mm", "along_mm", "across_mm")
_ALWAYS = ("delta_heading_deg", "delta_s_mm", "position_rms_mm", "heading_rms_deg")


class Verdict(StrEnum):
    """The verdict of a diagnosis."""

    ADEQUATE = "ADEQUATE"
    NAMED = "NAMED"
    AMBIGUOUS = "AMBIGUOUS"
    UNKNOWN = "UNKNOWN"
    NOT_IDENTIFIABLE = "NOT_IDENTIFIABLE"


@dataclass(frozen=True)
class Estimate:
    """A parameter's ``value`` with ``stderr`` and ``unit``; ``note`` says if the data do not determine it."""

    value: float
    stderr: float
    unit: str
    note: str = ""


@dataclass(frozen=True)
class NamedEffect:
    """An effect that meets the selection criterion.

    ``parameters``: estimates by name. ``confounded_with``: indistinguishable alternatives. ``evidence``: increase of
    the cross-validated deviance (minus two log likelihood) without the effect, and with each alternative in its place.
    ``prior``: the priors of its parameters. ``excluded_by_priors``: further alternatives without priors.
    """

    name: str
    parameters: Mapping[str, Estimate]
    confounded_with: tuple[str, ...]
    evidence: Mapping[str, object]


class State(StrEnum):
    """The state of an effect in a campaign."""

    PRESENT = "present"
    ABSENT = "absent"
    NOT_IDENTIFIABLE = "not_identifiable"


@dataclass(frozen=True)
class Bound:
    """The largest value in magnitude, or the smallest of a limit, that the runs leave possible (95 %), in ``unit``."""

    value: float
    unit: str
    is_limit: bool = False


@dataclass(frozen=True)
class EffectState:
    """The state of one effect of the library.

    ``bounds``: of an absent effect, by parameter; a parameter that the runs do not determine has none.
    ``indistinguishable_from``: effects that were selected and that it could replace. ``why``: the reason if it is not
    identifiable.
    """

    state: State
    bounds: Mapping[str, Bound] = field(default_factory=dict)
    indistinguishable_from: tuple[str, ...] = ()
    why: str = ""


@dataclass(frozen=True)
class HeldOut:
    """Errors in the test runs: by quantity (``end_position_mm`` …) ``before``, ``after``, and the spread of repeats.

    ``floor`` is the repeatability: repeats in succession. ``reproducibility`` is that of all repeats of the campaign;
    windows of free driving have none. ``worse_on`` names the trajectories or recordings whose error is larger after
    than before.
    """

    runs: int
    errors: Mapping[str, Mapping[str, float]]
    worse_on: tuple[str, ...]


@dataclass(frozen=True)
class Diagnosis:
    """The result of a diagnosis: the effects that the vehicle model lacks.

    ``verdict`` with ``why``, its reason. ``effects`` that were selected. ``depends_on``: dependences of the remaining
    residual; ``significant``: whether the residual shows structure. ``held_out``: errors in the test runs, None if
    nothing could be predicted. ``model``: the vehicle with refitted maps and the selected effects. ``rejected``: gains
    of effects that do not meet the criterion. ``provenance``. ``next_experiment``: the run that discriminates
    alternatives or identifies parameters, or None. ``states``: the state of each effect of the library.
    ``residuals``: the table of `agvbench.diagnosis.findings.residual_table`, for figures.
    """

    verdict: Verdict
    why: str
    effects: tuple[NamedEffect, ...] = ()
    significant: bool = False
    depends_on: tuple[Dependence, ...] = ()
    held_out: HeldOut | None = None
    model: VehicleModel | None = None
    rejected: Mapping[str, float] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    next_experiment: NextExperiment | None = None
    states: Mapping[str, EffectState] = field(default_factory=dict)
    residuals: pd.DataFrame | None = field(default=None, compare=False, repr=False)

    def __repr__(self) -> str:
        found = ", ".join(effect.name for effect in self.effects) or "none"
        return f"<Diagnosis {self.verdict}: effects {found}; {self.why}>"

    @property
    def adequate(self) -> bool:
        """Whether the static maps are sufficient."""
        return self.verdict is Verdict.ADEQUATE

    def effects_frame(self) -> pd.DataFrame:
        """Return one row per parameter of each effect found.

        Columns: ``effect``, ``parameter``, ``value`` and ``stderr`` in ``unit``, ``confounded_with`` (names, with
        commas between).
        """
        from agvbench.diagnosis.notebook import effects_frame

        return effects_frame(self)

    def states_frame(self) -> pd.DataFrame:
        """Return one row per effect of the library, and per bounded parameter of those that are absent.

        Columns: ``effect``, ``state``, ``parameter``, ``lower_bound``, ``upper_bound`` (95 %, of the magnitude) in
        ``unit``, ``indistinguishable_from`` (names, with commas between).
        """
        from agvbench.diagnosis.notebook import states_frame

        return states_frame(self)

    def errors_frame(self) -> pd.DataFrame:
        """Return one row per quantity, predicted for the test runs; without any where nothing could be predicted.

        Columns: ``quantity`` (its unit ends the name), ``before``, ``after``, ``floor`` (the repeatability) and
        ``reproducibility``.
        """
        from agvbench.diagnosis.notebook import errors_frame

        return errors_frame(self)

    def _repr_html_(self) -> str:
        from agvbench.diagnosis.notebook import diagnosis_html

        return diagnosis_html(self)

    def to_json(self) -> dict[str, Any]:
        """Return the content of the JSON file, schema 1; numbers that are not finite are null."""
        none: dict[str, dict[str, float]] = {}
        errors = self.held_out.errors if self.held_out else none
        content = {
            "schema": SCHEMA,
            "verdict": str(self.verdict),
            "effects": [_effect(effect) for effect in self.effects],
            "unexplained": {
                "significant": self.significant,
                "depends_on": [
                    {"covariate": d.covariate, "p_value": d.p_value, "share": d.share, "through": d.feature}
                    for d in self.depends_on
                ],
            },
            "held_out": {
                "runs": self.held_out.runs if self.held_out else 0,
                **{name: dict(errors[name]) for name in _FIRST if name in errors},
                **{name: dict(errors.get(name, {})) for name in _ALWAYS},
                "worse_on": list(self.held_out.worse_on) if self.held_out else [],
            },
            "next_experiment": None if self.next_experiment is None else self.next_experiment.to_table(),
            "states": {name: _state(state) for name, state in self.states.items()},
            "provenance": {"why": self.why, **self.provenance, "rejected": dict(self.rejected)},
        }
        return dict(_finite(content))

    def to_text(self) -> str:
        """Return the text of the JSON file; equal diagnoses have equal texts."""
        return json.dumps(self.to_json(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _effect(effect: NamedEffect) -> dict[str, Any]:
    return {
        "name": effect.name,
        "parameters": {
            name: {"value": e.value, "stderr": e.stderr, "unit": e.unit, **({"note": e.note} if e.note else {})}
            for name, e in effect.parameters.items()
        },
        "confounded_with": list(effect.confounded_with),
        "evidence": dict(effect.evidence),
        "remedy": effect_kinds()[effect.name].remedy if effect.name in effect_kinds() else "",
    }


def _state(effect: EffectState) -> dict[str, Any]:
    bounds: dict[str, dict[str, Any]] = {}
    for name, bound in effect.bounds.items():
        side = "lower_bound" if bound.is_limit else "upper_bound"
        bounds.setdefault(side, {})[name] = {"value": bound.value, "unit": bound.unit}
    return {
        "state": str(effect.state),
        **bounds,
        **({"indistinguishable_from": list(effect.indistinguishable_from)} if effect.indistinguishable_from else {}),
        **({"why": effect.why} if effect.why else {}),
    }


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value
