"""From each residual of the thesis' own models to the effect behind it: before and after, held out."""

from __future__ import annotations

from agvbench.workflows.thesis.chapter_8_carried import chapter_8_findings, chapter_8_table
from agvbench.workflows.thesis.idle_axle import arm_across_tables
from agvbench.workflows.thesis.layout import Cell, Section, Table
from agvbench.workflows.thesis.residual_cases import ROUNDING_MM_PER_S, kinematics_alone, traced


def residuals_section() -> Section:
    """Return residual, effect, before and after, for every table, and chapter 8's effects carried over."""
    values: dict[str, Cell] = {f"{t.name}_before": t.rms_before for t in traced()}
    values |= {f"{t.name}_after": t.rms_after for t in traced()}
    values["kinematics_alone_mm_per_s"] = kinematics_alone()
    findings = (*_findings(), *chapter_8_findings())
    tables = (_residual_table(), _idle_table(), chapter_8_table())
    return Section("residuals", "From residual to effect, held out", findings, tables, values)


def _residual_table() -> Table:
    columns: tuple[str, ...] = ("where", "before", "after", "effect", "size", "left out", "unit", "before, held out")
    columns += ("after, held out", "floor", "unexplained")
    rows = tuple(
        (
            t.source, t.before, t.after, t.effect, t.size, t.left_out, t.unit, t.rms_before, t.rms_after, t.floor,
            t.unexplained,
        )
        for t in traced()
    )  # fmt: skip
    narrow = ("where", "", "after", "effect", "size", "left out", "unit", "before", "held out", "floor", "")
    note = "Root mean squares of held-out errors; the floor of appendix B is its printed step of 10 mm/s."
    return Table("residuals", "From residual to effect", columns, rows, note, narrow, 3)


def _idle_table() -> Table:
    return Table(
        "residuals_idle_axle", "The idle axle, each table predicted with the other's effect",
        ("idle axle", "its mean [deg]", "lever arm [deg]", "coupling [deg]"),
        tuple((f"{a} axle", *values) for a, values in arm_across_tables().items()),
        "Only the axle's own mean is fitted to the table that is predicted.",
    )  # fmt: skip


def _findings() -> tuple[str, str, str]:
    return _shrinking(), _appendix_b(), _idle_axle()


def _shrinking() -> str:
    better = [t for t in traced() if t.rms_after < t.rms_before]
    each = "; ".join(f"{t.source} {t.rms_before:.3g} → {t.rms_after:.3g} {t.unit}" for t in better)
    return f"{len(better)} of {len(traced())} residuals shrink on what was left out: {each}."


def _appendix_b() -> str:
    cornering = next(t for t in traced() if t.name == "cornering")
    return (
        f"Appendix B: eq. 5.6 alone leaves {kinematics_alone():.1f} mm/s. Printing to 10 mm/s would leave "
        f"{ROUNDING_MM_PER_S:.1f}, which is {(ROUNDING_MM_PER_S / cornering.rms_after) ** 2:.0%} of the variance that "
        "the loss leaves: the rest is not explained."
    )


def _idle_axle() -> str:
    across = arm_across_tables()
    arm = " and ".join(f"{v[1]:.2f}° of {v[0]:.2f}° ({a})" for a, v in across.items())
    coupling = " and ".join(f"{v[2]:.2f}°" for v in across.values())
    return (
        f"The idle axle: one table's lever arm, carried to the other, leaves {arm}. One coupling for both servos fails "
        f"(it leaves {coupling}); two couplings fit as well as the arm, but then no table can check the other."
    )
