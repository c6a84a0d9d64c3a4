"""What ``agvbench diagnose`` does: read the campaign, diagnose it, print, and write JSON and vehicle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from agvbench.campaign import Campaign
from agvbench.diagnosis import Diagnosis, NamedEffect, diagnose
from agvbench.errors import FileError, FlagError
from agvbench.model import VehicleModel

_TITLES = {
    "position_rms_mm": "position along the way, mm",
    "heading_rms_deg": "heading along the way, °",
    "delta_s_mm": "Δs at the end, mm",
    "delta_heading_deg": "Δδ at the end, °",
}
_MOST_DEPENDENCES = 5


def run_diagnose(
    directory: str,
    *,
    json_file: str | None = None,
    out: str | None = None,
    vehicle: str | None = None,
    seed: int = 0,
) -> Diagnosis:
    """Diagnose the campaign in `directory`, print the answer, and write JSON and the corrected vehicle if asked for.

    Raises
    ------
    CampaignError, FitError, VehicleError
        If the campaign or the vehicle cannot be used.
    FileError, FlagError
        If a file cannot be written, or the seed is negative.
    """
    if seed < 0:
        raise FlagError("must not be negative", where="--seed", value=seed)
    campaign = Campaign.open(directory).check()
    believed = Path(vehicle) if vehicle is not None else campaign.path / "vehicle.toml"
    model = VehicleModel.load(believed) if vehicle is not None or believed.exists() else None
    errors = Console(stderr=True)
    if errors.is_terminal:
        with errors.status("reading runs") as status:
            found = diagnose(campaign, vehicle=model, seed=seed, tell=status.update)
    else:
        found = diagnose(campaign, vehicle=model, seed=seed)
    tell(found, Console())
    if json_file is not None:
        text = found.to_text()
        _write("--json", Path(json_file), lambda path: path.write_text(text, encoding="utf-8"))
    if out is not None and found.model is not None:
        _write("--out", Path(out), found.model.save)
    return found


def tell(found: Diagnosis, console: Console) -> None:
    """Print the answer in plain words."""
    console.print(f"[bold]{found.verdict}[/bold]: {found.why}", highlight=False, soft_wrap=True)
    for effect in found.effects:
        console.print(f"  {in_words(effect)}", highlight=False, markup=False, soft_wrap=True)
    for d in found.depends_on[:_MOST_DEPENDENCES]:
        text = f"the rest depends on {d.covariate} (through {d.feature}; {d.share:.0%} of it, p = {d.p_value:.1g})"
        console.print(f"  {text}", highlight=False, markup=False, soft_wrap=True)
    if found.held_out is not None:
        console.print(errors_table(found))
        if found.held_out.worse_on:
            console.print(f"  worse than before on: {', '.join(found.held_out.worse_on)}", soft_wrap=True)


def in_words(effect: NamedEffect) -> str:
    """Return one line on an effect: its parameters, and what cannot be told from it."""
    parts = []
    for name, e in effect.parameters.items():
        unit = "" if e.unit == "–" else f" {e.unit}"
        parts.append(f"{name} = {e.value:.4g} ± {e.stderr:.2g}{unit}" + (f" ({e.note})" if e.note else ""))
    line = f"{effect.name}: {', '.join(parts)}"
    return line + (f"; or instead {', '.join(effect.confounded_with)}" if effect.confounded_with else "")


def errors_table(found: Diagnosis) -> Table:
    """Return errors before and after beside the floor."""
    held = found.held_out
    runs = held.runs if held else 0
    table = Table(
        title=f"prediction errors of {runs} runs held out (root mean square)", box=box.SIMPLE_HEAD, title_justify="left"
    )
    table.add_column("")
    for heading in ("before", "after", "floor"):
        table.add_column(heading, justify="right")
    for name, errors in (held.errors if held else {}).items():
        table.add_row(_TITLES[name], *(f"{errors[column]:.2f}" for column in ("before", "after", "floor")))
    return table


def _write(flag: str, path: Path, write: Callable[[Path], object]) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(path)
    except OSError as error:
        remedy = f"give {flag} a place you may write to"
        raise FileError("cannot be written", where=path, value=error.strerror, remedy=remedy) from None
