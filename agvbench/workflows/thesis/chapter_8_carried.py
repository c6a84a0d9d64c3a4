"""Chapter 8, one effect at a time, carried from one condition's drives to the other's: the table, and what it says."""

from __future__ import annotations

from agvbench.workflows.thesis.assumptions import Assumptions
from agvbench.workflows.thesis.chapter_8_effects import CAUSES, Checked, checks, null_error, predicted, rows_with
from agvbench.workflows.thesis.layout import Table
from agvbench.workflows.thesis.scoring import CONDITIONS


def chapter_8_table() -> Table:
    """Return each effect's value from either condition, and the errors before and after on the other's drives."""
    plain = rows_with(None, 0.0)
    null = {c: null_error(r for r in plain if r.measured.condition == c) for c in CONDITIONS}
    columns: tuple[str, ...] = ("effect", "unit", "from uncalibrated", "from calibrated")
    columns += ("calibrated before", "after", "uncalibrated before", "after, back", "left out before", "left out after")
    columns += ("carries over",)
    rows = tuple(
        (
            k.cause.name, k.cause.unit, k.value["uncalibrated"], k.value["calibrated"], k.before["calibrated"],
            k.after["calibrated"], k.before["uncalibrated"], k.after["uncalibrated"], k.left_out_before,
            k.left_out_after, k.carries_over,
        )
        for k in checks()
    )  # fmt: skip
    note = (
        "Mean errors over the null's median error of their kind. Fitted to the rows of one condition, checked on the "
        f"other's; 'left out' is one trajectory at a time. The null scores {null['calibrated']:.2f} calibrated and "
        f"{null['uncalibrated']:.2f} uncalibrated."
    )
    return Table("residuals_chapter_8", "Chapter 8: one effect at a time, carried over", columns, rows, note, (), 3)


def asymmetry_with(checked: Checked) -> tuple[float, float, float]:
    """Return how much farther [mm] calibrated right turns miss than left ones: measured, plain, and with an effect.

    The effect has the value that the uncalibrated rows give it.
    """
    measured = {
        r.measured.trajectory: r.measured.median
        for r in rows_with(None, 0.0)
        if r.measured.condition == "calibrated" and r.measured.quantity == "delta_s_mm"
    }
    out = [measured]
    for cause, value in ((None, 0.0), (checked.cause, checked.value["uncalibrated"])):
        made = predicted(cause, value, "calibrated", Assumptions())
        out.append({p.trajectory.number: abs(p.delta_s_mm) for p in made})
    right_less_left = [0.5 * (d[6] + d[8] - d[5] - d[7]) for d in out]
    return right_less_left[0], right_less_left[1], right_less_left[2]


def chapter_8_findings() -> list[str]:
    """Return how many effects carry over, and what the first of them make of the turns."""
    carried = [k for k in checks() if k.carries_over]
    null = null_error(r for r in rows_with(None, 0.0) if r.measured.condition == "calibrated")
    best = min(k.after["calibrated"] for k in checks())
    return [
        f"Chapter 8: of {len(CAUSES)} effects, {len(carried)} help on the drives they were not fitted to, both "
        "ways and by trajectory"
        + (f" ({', '.join(k.cause.name for k in carried)})" if carried else "")
        + f". The best of all scores {best:.2f} on the calibrated rows, where 'it hits the target' scores "
        f"{null:.2f}: on medians of unsigned errors, and after trying {len(CAUSES)}, none is established. A "
        "constant curvature is also what a neutral that is off does: calibration, before it is a cause.",
        *map(_asymmetry, carried[:2]),
    ]


def _asymmetry(checked: Checked) -> str:
    measured, before, after = asymmetry_with(checked)
    return (
        f"Calibrated right turns miss by {measured:.0f} mm more than left ones; predicted {before:+.0f}, and "
        f"{after:+.0f} with {checked.cause.name} at {checked.value['uncalibrated']:.3g} {checked.cause.unit}, the "
        f"value of the uncalibrated drives ({checked.value['calibrated']:.3g} from the calibrated)."
    )
