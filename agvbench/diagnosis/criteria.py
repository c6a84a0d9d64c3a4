"""The criteria of a diagnosis: every constant that decides what is selected, tested or refused, with its reason.

Every diagnosis states them under ``provenance.criteria``. Constants that only set a resolution or a tolerance of the
arithmetic stand beside the code that uses them.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class DataCriteria:
    """What a campaign must contain, and how its runs are divided.

    ``min_runs``
        Runs from rest. A model has about fifteen nodal values, and fewer runs leave no residual to judge it.
    ``min_repeated_groups``
        Groups of equal commands with repeats. The repeatability needs their degrees of freedom.
    ``min_turn_rad``
        Largest heading change of a campaign [rad]. Below it no run shows what the steering does.
    ``test_share``
        Share of the groups of runs that is set apart for the test. A quarter leaves most commands in the fit.
    ``max_selection_runs``
        Runs in the selection of effects, unless two repeats per group are more. The campaigns of the blind trials have
        169 training runs. Time grows with the number of runs, and the chosen model is refitted to all training runs.
    ``min_windows``, ``min_blocks``
        Windows of free driving, and blocks of 10 s. Adjacent windows are strongly correlated, and blocks are not.
    ``max_fitted_windows``, ``max_assessed_windows``
        Windows in a fit, and windows for which errors are reported, evenly spaced.
    ``max_fitted_commands``, ``min_fitted_windows``
        A fit has fewer windows, but no fewer than these, where more commands take effect within them: time grows with
        their number. With 121 of 300 windows an effect of a simulated vehicle gained 47 % as much.
    """

    min_runs: int = 20
    min_repeated_groups: int = 3
    min_turn_rad: float = 0.05
    test_share: float = 0.25
    max_selection_runs: int = 170
    min_windows: int = 20
    min_blocks: int = 5
    max_fitted_windows: int = 300
    max_assessed_windows: int = 1500
    max_fitted_commands: int = 8000
    min_fitted_windows: int = 100


@dataclass(frozen=True)
class MapCriteria:
    """How much a static map may bend between its nodes.

    ``slope_change``
        Standard deviation of the change of slope over half the range of commands, relative to the mean slope. The
        linkage of a servo changes its slope by a third.
    ``deviation``
        Standard deviation of single levels from a smooth map, relative to 45° or the top speed. A servo resolves 0.1°.
    ``kink_degrees_of_freedom``
        Degrees of freedom of Student's t distribution of the changes of slope. Few make kinks cheap.
    """

    slope_change: float = 0.5
    deviation: float = 0.002
    kink_degrees_of_freedom: float = 3.0


@dataclass(frozen=True)
class FitCriteria:
    """When a fit is started, continued and ended. Differences are in minus two log likelihood.

    ``few_steps``, ``steps``
        Steps of a preliminary fit, which only ranks initial values, and of a round of a fit to convergence.
    ``converged``, ``nearly_converged``
        Reduction by a step below which a fit has converged, and below which it nearly has. It then computes
        its own derivatives in place of those of a similar model, or keeps its own for the remaining steps.
    ``min_reduction``
        Least reduction for which a fit that converges slowly goes on. It is below the margin of alternatives.
    ``rounds``, ``non_monotone_steps``
        Rounds of a patient fit, and full steps that may increase the loss (watchdog technique).
    ``min_predicted_gain``
        An effect whose gain is predicted to be smaller is not fitted. It is a quarter of the least gain of an effect.
    ``large_predicted_gain``
        An effect whose gain is predicted to be larger is fitted to convergence even if its first steps gain nothing.
    ``min_share_of_predicted_gain``
        A fit that gains less than this share of the prediction has ended in a local minimum, and starts elsewhere.
    ``max_starts``, ``max_increase``
        Initial values that are tried, and the increase of the loss in a preliminary fit that starts elsewhere.
    """

    few_steps: int = 3
    steps: int = 10
    converged: float = 0.05
    nearly_converged: float = 1.0
    min_reduction: float = 10.0
    rounds: int = 4
    non_monotone_steps: int = 6
    min_predicted_gain: float = 3.0
    large_predicted_gain: float = 40.0
    min_share_of_predicted_gain: float = 0.5
    max_starts: int = 2
    max_increase: float = 20.0


@dataclass(frozen=True)
class SelectionCriteria:
    """When an effect belongs to the model. Gains are differences of the cross-validated deviance.

    ``min_gain``
        Least gain of an effect; twice the logarithm of the number of candidates is added to it. With nothing hidden,
        the largest gain of any candidate exceeds the sum in fewer than 1 of 100 campaigns.
    ``alternative_margin``
        Largest difference to an indistinguishable alternative: a likelihood ratio of about 150.
    ``min_relative_change``
        Least change of the prediction by an effect, relative to the residual that remains with it. A smaller change is
        not noticeable, however significant.
    ``trimmed_share``
        Share of the groups of runs with the largest gains, and of those with the smallest, without which an effect must
        still gain.
    ``likely_share``
        Share of an effect's gain in fit that another must be predicted to take, to first order, to be fitted in its
        place. It is low, because such predictions may be several times too small.
    ``superior_share``
        An effect that is predicted to gain less than this share of what another one gains is not fitted in that step.
        A gain that is predicted to first order is rarely more than twice too small. In free driving it is zero: a lag
        and a slip resemble each other, and the one that gains more may be predicted to gain less than half.
    ``likely_gain_share``
        An effect that is predicted to gain less than this share of the least gain of an effect is not fitted. Random
        effects of runs from rest absorb a cause, so that predictions may be several times too small: there it is zero.
    ``group_by_gain``
        Whether an effect of a group that was fitted together is judged by ``min_gain`` alone. It was not searched for
        among many, and a time constant of which only a lower bound is known has no finite standard error.
    ``wald_alpha``
        Level at which the parameters of an effect must differ from their null values, with errors clustered by group.
    ``by_likelihood_ratio``
        Whether an effect of which Wald's test is not significant may be by the likelihood ratio, at the same level.
    ``camera_share``
        If the residuals show structure, actuators take the place of a latency of the camera unless they lose more than
        this share of its gain.
    ``min_gain_of_initial_steering``
        Predicted gain of slow steering above which the other initial steering is fitted.
    ``large_loss_of_removal``
        If the removal of an effect increases the loss by more, the maps are also fitted from those of the base model.
        Windows have no random effects that maps could have released: there it is never done. Of nine such fits none
        made an effect unnecessary.
    ``max_predicted_loss``
        An effect is removed beside a variant if that is predicted to lose less. For runs from rest such predictions are
        up to forty times too large, because random effects and their standard deviations grow in a fit. Windows have
        none but the start pose, and predictions of 79 to 698 were 1.5 to 2.3 times too large.
    """

    min_gain: float = 12.0
    alternative_margin: float = 10.0
    min_relative_change: float = 0.15
    trimmed_share: float = 0.05
    likely_share: float = 0.1
    superior_share: float = 0.5
    likely_gain_share: float = 0.0
    group_by_gain: bool = False
    wald_alpha: float = 1e-4
    by_likelihood_ratio: bool = False
    camera_share: float = 0.1
    min_gain_of_initial_steering: float = 20.0
    large_loss_of_removal: float = 500.0
    max_predicted_loss: float = 1000.0


@dataclass(frozen=True)
class VariantCriteria:
    """Which effects are tried with other equations.

    ``max_fit_loss``
        No effect is removed beside a variant that fits worse by more: a model with fewer effects fits no better.
    ``max_share_of_loss``
        An effect is removed beside a variant if that is predicted to lose less than this share of what its removal is
        predicted to lose without the variant, or little (see `SelectionCriteria`). Both predictions are quadratic.
    ``min_gain_share``
        Another effect with a smaller share of the selected effect's gain is not tried in its variants.
    """

    max_fit_loss: float = 100.0
    max_share_of_loss: float = 0.25
    min_gain_share: float = 0.5


@dataclass(frozen=True)
class DiscrepancyCriteria:
    """When a discrepancy term stands for a cause outside the library, and which effects are kept beside it.

    ``min_predicted_gain``, ``min_share_of_best_start``, ``max_starts``
        Starts of terms that are fitted: predicted to gain this much, and this share of what the best is predicted to
        gain, and at most this many, because each is a fit of several seconds.
    ``max_refitted``
        Effects that are reconsidered beside a term in one step.
    ``max_terms``
        Terms beside each other. Each needs the runs to determine its parameters, and about five seconds.
    ``min_share_of_effects``
        A term takes the place of effects, or of one of them, only if it gains this share of what they gain without it.
    """

    min_predicted_gain: float = 4.0
    min_share_of_best_start: float = 0.3
    max_starts: int = 3
    max_refitted: int = 3
    max_terms: int = 3
    min_share_of_effects: float = 0.2


@dataclass(frozen=True)
class ResidualCriteria:
    """When the residual shows structure.

    ``within_repeatability``
        A residual below this multiple of the repeatability is within it. The ratio of two standard deviations with
        twenty degrees of freedom each exceeds it in one of six comparisons by chance, so that a test decides beyond it.
    ``far_beyond_repeatability``
        Multiple of the repeatability beyond which a bias of repeats is a lack of fit by itself. Errors of the fitted
        parameters bias repeats, too, but by less than the repeatability.
    ``lack_of_fit_alpha``
        Level of the lack-of-fit test and of the test for a bias.
    ``dependence_alpha``, ``likely_alpha``
        Levels of a dependence after the correction for the number of tests: for a residual of which nothing is known,
        and for one that is known to have structure.
    ``min_share``
        Smallest share of the variance that a reported dependence predicts.
    ``periodic_alpha``
        Level of the test for a periodic disturbance with random phase. The number of permutations resolves it.
    ``far_above_noise``, ``typical_repeatability``
        Ratio to the noise above which residuals of windows count as structure. Without repeats the repeatability is
        unknown, and taken for this share of distance and turn beside the noise of frames.
    ``left_out_folds``
        Parts of the training runs that are predicted by fits to the others, as a further validation.
    ``validation_standard_errors``
        Effects are rejected if the mean squared position error of the validation runs is larger with them by more than
        this number of its standard errors. For runs that are left out, a smaller difference is chance either way.
    """

    within_repeatability: float = 1.25
    far_beyond_repeatability: float = 2.0
    lack_of_fit_alpha: float = 0.01
    dependence_alpha: float = 1e-3
    likely_alpha: float = 0.05
    min_share: float = 0.02
    periodic_alpha: float = 5e-3
    far_above_noise: float = 5.0
    typical_repeatability: float = 0.01
    left_out_folds: int = 3
    validation_standard_errors: float = 2.0


@dataclass(frozen=True)
class DriveLevelCriteria:
    """When sessions of free driving differ in the level of the drive.

    ``alpha``
        Level of the test, for all sessions together.
    ``min_deviation``
        Least difference of the logarithm of the speed. A battery and the temperature of tyres change it by a few
        percent within a session.
    """

    alpha: float = 1e-3
    min_deviation: float = 0.05


@dataclass(frozen=True)
class VaryingCriteria:
    """How much steering, drive, clock and rigid body may differ between recordings, and how fast they drift.

    ``offset_rad``, ``offset_per_m``, ``offset_s``, ``gain``
        Typical difference between recordings: of an axle angle or of the measured heading [rad], of the curvature of a
        differential vehicle's path [1/m], of the clocks of camera and vehicle [s], and of the logarithm of a gain.
    ``share_within``
        Typical variation within a recording, for seconds, as a share of that.
    ``spread_between``, ``spread_within``
        Standard deviations of the logarithms of both. Two or three recordings hardly tell how much recordings differ.
    ``drift_s``, ``spread_drift``
        Time in which a parameter typically drifts as far as recordings differ, and the standard deviation of its
        logarithm.
    ``within_s``
        Time for which a variation within a recording lasts.
    ``ahead_s``
        A variation is predicted this far ahead, about the middle of a window.
    ``time_error_s``, ``spread_time_error``
        Typical error of the model in time, and the standard deviation of its logarithm.
    ``at_beginning``, ``spread_at_beginning``
        Typical error of the model at the beginning of a run, as a share of the distance, because what was commanded
        before is not known, and the standard deviation of its logarithm.
    ``least_map_change``, ``max_map_components``
        Components of the uncertainty of the maps with a standard deviation of this share of a map's largest value are
        estimated, and at most this many.
    """

    offset_rad: float = 0.02
    offset_per_m: float = 0.02
    offset_s: float = 0.05
    gain: float = 0.1
    share_within: float = 0.3
    spread_between: float = 0.5
    spread_within: float = 1.5
    drift_s: float = 120.0
    spread_drift: float = 0.3
    within_s: float = 3.0
    ahead_s: float = 1.0
    time_error_s: float = 0.1
    spread_time_error: float = 0.7
    at_beginning: float = 0.05
    spread_at_beginning: float = 1.5
    least_map_change: float = 0.01
    max_map_components: int = 16


@dataclass(frozen=True)
class SessionClockCriteria:
    """When the clocks of camera and vehicle differ by another offset in one session of free driving.

    ``alpha``
        Level of the test, for all sessions together.
    ``min_offset_s``
        Least offset: commands and poses of most loggers are a few hundredths of a second apart.
    ``adapted_s``
        Part at the beginning of a test session from which its offset is estimated; it is not part of the test.
    ``min_blocks``, ``least_stderr_s``
        Least number of blocks of 2 s for a standard error, and the smallest one: few blocks may agree by chance.
    ``max_stderr_s``
        Largest standard error: where steering changes slowly, play and other causes look like an offset.
    ``min_speed_mps``
        Least speed at which the yaw rate of steered axles tells their angle.
    """

    alpha: float = 1e-3
    min_offset_s: float = 0.04
    adapted_s: float = 20.0
    min_blocks: int = 3
    least_stderr_s: float = 0.004
    max_stderr_s: float = 0.02
    min_speed_mps: float = 0.1


@dataclass(frozen=True)
class LoggedCriteria:
    """Which columns that a lab logged are covariates.

    ``max_regressors``
        Numbers per run that enter tests and terms: one for a column of numbers, and one for each level of a text (one
        for two levels). Each is tested against every feature. Sixteen raise the number of tests by less than half, and
        with it the size that a dependence needs to be significant.
    ``max_levels``
        Levels of a text. A text with more is a remark or an identifier.
    ``min_runs``
        Runs (or windows) with a value. It is the least size of a campaign.
    ``min_level_runs``
        Runs of a level of a text; a level with fewer counts as missing. Fewer runs give it no repeatability.
    ``same_as_time``
        Squared correlation with campaign time above which the order of runs is no covariate of its own.
    ``max_standardised``
        Largest standardised number in a term: a typing error must not decide its size.
    """

    max_regressors: int = 16
    max_levels: int = 8
    min_runs: int = 20
    min_level_runs: int = 3
    same_as_time: float = 0.9
    max_standardised: float = 4.0


@dataclass(frozen=True)
class DesignCriteria:
    """When a next experiment is proposed. Differences are expected ones in minus two log likelihood.

    ``decisive``
        A difference that is beyond the margin of alternatives in 99 of 100 campaigns.
    ``min_evidence``
        Least difference that ``max_repeats`` must give; otherwise no run is proposed for the pair.
    ``min_repeats``, ``max_repeats``
        Repeats of a proposed run: enough for a repeatability, and few enough for a quarter of an hour.
    ``identified``
        A parameter is identified if its standard error is below this share of its typical size.
    """

    decisive: float = 40.0
    min_evidence: float = 10.0
    min_repeats: int = 4
    max_repeats: int = 12
    identified: float = 0.5


@dataclass(frozen=True)
class PriorCriteria:
    """When a campaign contradicts a prior of an effect; stated only if the vehicle file has priors.

    ``max_conflict``
        Largest distance between prior and campaign in combined standard deviations; one of 370 true priors exceeds it.
    ``max_leverage``
        Largest share of the prior in the information about its quantity. Beyond it the campaign alone says nothing.
    """

    max_conflict: float = 3.0
    max_leverage: float = 0.999


DATA = DataCriteria()
MAPS = MapCriteria()
FIT = FitCriteria()
SELECTION = SelectionCriteria()
FREE_DRIVING = SelectionCriteria(
    min_relative_change=0.3,
    trimmed_share=0.0,
    superior_share=0.0,
    likely_gain_share=0.5,
    group_by_gain=True,
    by_likelihood_ratio=True,
    large_loss_of_removal=math.inf,
    max_predicted_loss=50.0,
)
"""Criteria for windows of free driving. Their residuals are mostly systematic, so that a small change of the prediction
is no evidence; blocks of fast driving may be few, so that only one block is left out at each end. Unplanned
commands determine the parameters of an effect together rather than each."""

VARIANT = VariantCriteria()
DISCREPANCY = DiscrepancyCriteria()
RESIDUAL = ResidualCriteria()
LOGGED = LoggedCriteria()
DESIGN = DesignCriteria()
PRIOR = PriorCriteria()
FREE_DRIVING_LEVEL = DriveLevelCriteria()
VARYING = VaryingCriteria()
SESSION_CLOCK = SessionClockCriteria()


def stated_criteria(
    selection: SelectionCriteria = SELECTION, *, with_priors: bool = False
) -> dict[str, dict[str, float]]:
    """Return every criterion with its value, by class, for the provenance of a diagnosis with this `selection`."""
    return {
        "data": asdict(DATA),
        "maps": asdict(MAPS),
        "fit": asdict(FIT),
        "selection": asdict(selection),
        "variant": asdict(VARIANT),
        "discrepancy": asdict(DISCREPANCY),
        "residual": asdict(RESIDUAL),
        "design": asdict(DESIGN),
        **({"prior": asdict(PRIOR)} if with_priors else {}),
    }
