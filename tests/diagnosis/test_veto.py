"""Validation runs decide what is kept, and test runs decide nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_vehicle import FRONT_M, HEADER, NEUTRAL_COMMAND, REAR_M, InMemory, Tiny

from agvbench.diagnosis import Verdict, diagnose
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.data.splits import split_runs, with_other_validation
from agvbench.diagnosis.estimation.levenberg_marquardt import LevenbergMarquardt
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import ROLES, nodal_maps
from agvbench.diagnosis.model.steady_drives import start_values, steady_drives
from agvbench.diagnosis.selection.candidates import candidates
from agvbench.diagnosis.selection.refused_effects import with_refused_effects
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.validation import _is_better, predicts, predicts_left_out, validated
from agvbench.diagnosis.selection.variants import variant_candidates, with_extended_library
from agvbench.diagnosis.selection.with_term import SelectedTerm, TermSelection
from agvbench.diagnosis.terms.speed import SpeedInDisc
from agvbench.vehicle.geometry import Geometry


def chooser(campaign):
    """Return who chooses among causes of what a campaign shows, all its runs, and which are set aside."""
    runs = list(campaign)
    readings, geometry = read_runs(runs, HEADER.neutral), Geometry(FRONT_M, REAR_M)
    held = ~split_runs(readings.runs, readings.group, HEADER.neutral, 0).training
    maps = nodal_maps(readings.runs, NEUTRAL_COMMAND)
    prior_model = {role: np.zeros(len(maps.nodes[role])) for role in ROLES}
    start = start_values(maps, steady_drives(runs, geometry, NEUTRAL_COMMAND), prior_model)
    batch = Batch(readings.select(~held), maps, geometry)
    return Selector(batch, candidates(geometry), start, 0, lambda _: None), readings, held


@pytest.fixture(scope="module")
def tried(tiny_campaign):
    return chooser(tiny_campaign(Tiny(steering_lag_s=0.15)))


@pytest.fixture(scope="module")
def found(tried):
    """Return a selection of the steering lag, and the runs set aside."""
    selector, readings, held = tried
    base = selector.base()
    lag = selector.with_effect(base, "steering_lag")
    return Selection(base, lag, {}, {"steering_lag": 500.0}, {}, 2), readings.select(held)


@pytest.fixture
def spoilt(found):
    """Return the selection with a lag that is far off."""
    selection, _ = found
    wrong = selection.chosen.fit.parameters.copy()
    wrong[-1] = 0.9
    return replace(selection, chosen=replace(selection.chosen, fit=replace(selection.chosen.fit, parameters=wrong)))


def test_a_term_that_makes_it_worse_is_withdrawn_and_the_effects_are_asked_alone(found, spoilt):
    good, kept = found
    disc = SelectedTerm(SpeedInDisc, good.base, 100.0, 1e-4)
    wrong = TermSelection(spoilt, (disc,), good.base)
    left, term = validated(good, wrong, kept, lambda _: None)
    assert term is None
    assert left.chosen is good.chosen
    both_wrong, no_term = validated(spoilt, wrong, kept, lambda _: None)
    assert no_term is None
    assert both_wrong.chosen is good.base
    right = TermSelection(good, (disc,), good.base)
    assert validated(spoilt, right, kept, lambda _: None) == (spoilt, right)


def test_the_parameters_of_a_term_are_those_of_the_model_that_was_fitted_last(tried):
    selector, _, _ = tried
    base, extended = selector.base(), with_extended_library(selector)
    disc = extended.score((SpeedInDisc.name,), np.r_[base.fit.parameters, 0.1, 0.2, 0.3, 0.4], None)
    selected = TermSelection(
        Selection(base, disc, {}, {}, {}, 1), (SelectedTerm(SpeedInDisc, base, 100.0, 1e-4),), base
    )
    again = disc.fit.parameters.copy()
    again[-4:] = 0.15, 0.25, 0.35, 0.45
    refitted = replace(disc, fit=replace(disc.fit, parameters=again))
    selected = replace(selected, selection=replace(selected.selection, chosen=refitted))
    (entry,) = selected.entries
    assert entry["parameters"] == {"loss": 0.15, "x_m": 0.25, "y_m": 0.35, "radius_m": 0.45}


def test_runs_that_are_left_out_are_predicted_better_with_a_cause_that_is_there(tried):
    selector, _, _ = tried
    base = selector.base()
    lag = selector.with_effect(base, "steering_lag")
    assert predicts_left_out(lag, base, selector)
    assert not predicts_left_out(base, lag, selector)


@pytest.mark.parametrize(
    ("gain_mm2", "deviance", "is_better"),
    [(60.0, 1.0, True), (5.0, 1.0, False), (5.0, -1.0, True), (-5.0, -1.0, True), (-60.0, -1.0, False)],
)
def test_within_chance_the_deviance_decides(gain_mm2, deviance, is_better):
    """The differences between the runs scatter by 100 mm²: 20 mm² is chance in the mean of 100 runs."""
    base = np.full(100, 500e-6)
    own = base - (gain_mm2 + 100.0 * np.tile([-1.0, 1.0], 50)) * 1e-6
    assert _is_better((deviance, own), (0.0, base)) is is_better


@pytest.mark.parametrize("deviance", [-1.0, 1.0])
def test_few_groups_with_large_errors_do_not_decide_for_the_others(deviance):
    """The means are equal within chance, and 95 of 100 groups have smaller errors."""
    rng = np.random.default_rng(0)
    base = rng.uniform(200e-6, 800e-6, 100)
    own = np.where(np.arange(100) % 20, 0.6 * base, 6.0 * base)
    assert _is_better((deviance, own), (0.0, base))
    assert not _is_better((deviance, base), (0.0, own))


def test_the_maps_alone_are_not_fitted_again_to_be_compared_with_themselves(tried, monkeypatch):
    selector, _, _ = tried
    base = selector.base()
    monkeypatch.setattr(Selector, "for_batch", None)
    assert predicts_left_out(base, base, selector)


def test_a_single_group_cannot_be_left_out(tried):
    selector, _, _ = tried
    base, readings = selector.base(), selector.batch.readings
    lag = selector.with_effect(base, "steering_lag")
    one = readings.select(readings.group == readings.group[0])
    alone = selector.for_batch(Batch(one, selector.batch.maps, selector.batch.geometry))
    assert predicts_left_out(lag, base, alone)


def test_a_model_that_cannot_be_evaluated_predicts_nothing(found, spoilt, monkeypatch):
    selection, kept = found

    def diverges(solver, state, near=None):
        if state.parameters is spoilt.chosen.fit.parameters:
            raise np.linalg.LinAlgError
        return evaluate(solver, state, near)

    evaluate = LevenbergMarquardt.evaluate
    monkeypatch.setattr(LevenbergMarquardt, "evaluate", diverges)
    assert not predicts(spoilt.chosen, selection.base, kept)
    assert predicts(selection.chosen, spoilt.chosen, kept)


def test_a_cause_that_helps_stays(found):
    selection, kept = found
    said: list[str] = []
    assert validated(selection, None, kept, said.append) == (selection, None)
    assert not said


def test_a_cause_that_makes_it_worse_is_withdrawn(found, spoilt):
    _, kept = found
    said: list[str] = []
    left, term = validated(spoilt, None, kept, said.append)
    assert term is None
    assert left.chosen is spoilt.base
    assert left.gains == left.alternatives == {}
    assert left.rejected == {"steering_lag": 500.0}
    assert said == ["steering_lag: rejected in validation: the validation runs are predicted better without"]


@pytest.mark.slow
def test_test_runs_change_no_name_and_no_parameter(tiny_campaign):
    tiring, opposite = (list(tiny_campaign(Tiny(droop_per_hour=droop))) for droop in (0.1, -0.1))
    readings = read_runs(tiring, HEADER.neutral)
    names = split_runs(readings.runs, readings.group, HEADER.neutral, 0).names
    runs = [
        replace(other if name == "held_out" else own, split=name)
        for own, other, name in zip(tiring, opposite, names, strict=True)
    ]
    found = diagnose(InMemory(runs))
    assert [effect.name for effect in found.effects] == ["battery_droop"]
    assert found.effects[0].parameters["per_hour"].value == pytest.approx(0.1, rel=0.05)
    assert found.held_out.runs == names.count("held_out")
    # Half of the groups suffice, for what repeats scatter is known from validation runs, too.
    assert found.verdict is Verdict.UNKNOWN
    assert found.provenance["lack_of_fit_p_value"] < 1e-5
    runs = {"tested": names.count("held_out"), "repeats": len(names) - names.count("fit")}
    assert found.provenance["lack_of_fit_runs"] == runs
    assert found.held_out.errors["position_rms_mm"]["after"] > found.held_out.errors["position_rms_mm"]["before"]


@pytest.mark.slow
def test_validation_runs_that_reject_everything_join_the_training_runs(tiny_campaign):
    late, prompt = (list(tiny_campaign(Tiny(delay_s=delay))) for delay in (0.1, 0.0))
    readings = read_runs(late, HEADER.neutral)
    split = split_runs(readings.runs, readings.group, HEADER.neutral, 0)
    runs = [other if v else own for own, other, v in zip(late, prompt, split.validation, strict=True)]
    said = []
    found = diagnose(InMemory(runs), on_progress=said.append)
    again = with_other_validation(split, readings.runs, readings.group, HEADER.neutral, 0)
    repeated = said.index("the selection is repeated with these runs among the training runs")
    assert "rejected in validation" in said[repeated - 1]
    assert said[repeated + 1].startswith(f"{again.training.sum()} training runs, {again.validation.sum()} validation")
    assert found.held_out.runs == split.test.sum()


def test_a_variant_that_the_simulation_lacks_is_no_further_candidate(tried):
    selector, _, _ = tried
    selector = selector.for_batch(selector.batch)
    selector.candidates |= {"actuation_delay_uneven": variant_candidates()["actuation_delay_uneven"]}
    base = selector.base()
    assert "actuation_delay_uneven" not in selector.further(base)
    assert "actuation_delay_uneven" in with_extended_library(selector).further(base)
    selection = Selection(base, base, {}, {}, {}, 0)
    assert with_refused_effects(selection, selector).base is base
