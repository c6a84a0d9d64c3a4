"""Firmware 1 against firmware 2, and what the servo frame's variable delay makes of the spread of end poses.

The same campaign (the eight trajectories, the same seed, a vehicle without variation whose maps are known) is driven
through the whole loop: without firmware, with either version, and with version 2 always at the same phase of its frame.
Version 1 is then compared with version 2 by ``agvbench compare``. Single rides add what no campaign has: the worst
duration there is, and version 2 timing the segments on board.

``--repeats N`` (default 20), ``--out DIR`` (default: a new one under the temporary directory); needs
``nox -s firmware``.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from firmware_needed import exit_code
from firmware_rides import FRAME_S, Rides
from firmware_vehicle import nominal_vehicle

from agvbench.campaign import Campaign
from agvbench.planning import load_trajectory, plan
from agvbench.statistics import pose_errors
from agvbench.statistics.end_poses import CASES, published_end_poses
from agvbench.types import Commands, Floats, Pose

if TYPE_CHECKING:
    import pandas as pd

PLANT = f"{Path(__file__).with_name('firmware_vehicle.py')}:make_plant"
PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
ARMS = {
    "none": "sim",
    "1": "simavr:1",
    "2": "simavr:2",
    "2, one phase": "simavr:2,phase_ms=0",
}
"""Adapters by what the tables call them."""
QUANTITIES = {"delta_s_mm": "Δs [mm]", "delta_heading_deg": "Δδ [°]"}
PHASES, RESAMPLES = 40, 4000
IQR_TO_SD = 1.349
"""Quartiles of a normal distribution are this many standard deviations apart."""


def agvbench(*arguments: str) -> None:
    """Run a command of agvbench; end where it fails."""
    done = subprocess.run([sys.executable, "-c", PROGRAM, *arguments], check=False)  # noqa: S603  (our own program)
    if done.returncode == 2:
        sys.exit(2)


def drive(folder: Path, vehicle: Path, repeats: int) -> dict[str, Path]:
    """Return a campaign for every arm."""
    campaigns = {arm: folder / f"firmware {arm}" for arm in ARMS}
    for arm, path in campaigns.items():
        print(f"\n── firmware {arm}: {ARMS[arm]}, seen by natnet:emulated", flush=True)
        agvbench(
            "bench", "trajectories", "-k", "not uncal", f"--repeats={repeats}", f"--agv={ARMS[arm]}",
            "--mocap=natnet:emulated", f"--plant={PLANT}", f"--calibration={vehicle}", "--no-report", f"--out={path}",
        )  # fmt: skip
    return campaigns


def sd_interval(values: Floats, seed: int = 0) -> tuple[float, float, float]:
    """Return the standard deviation of `values` (n,) and the bounds of its 95 % bootstrap interval."""
    drawn = values[np.random.default_rng(seed).integers(0, len(values), (RESAMPLES, len(values)))]
    low, high = np.percentile(drawn.std(axis=1, ddof=1), (2.5, 97.5))
    return float(values.std(ddof=1)), float(low), float(high)


def thesis_sd() -> dict[tuple[int, str], float]:
    """Return the standard deviation that the thesis' quartiles of ten calibrated repeats stand for.

    Its errors are without sign, which can only narrow them: on straights it is a lower bound.
    """
    table = published_end_poses().query("condition == 'calibrated'")
    quartiles = zip(table["trajectory"], table["quantity"], table["q1"], table["q3"], strict=True)
    return {(case, quantity): (q3 - q1) / IQR_TO_SD for case, quantity, q1, q3 in quartiles}


def errors_of(ends: Floats, target: Pose) -> dict[str, Floats]:
    """Return the errors of end poses (n, 3) of rides from (0, 0, 0)."""
    distance = np.hypot(ends[:, 0], ends[:, 1]) - np.hypot(target.x_m, target.y_m)
    turned = np.remainder(ends[:, 2] - target.heading_rad + np.pi, 2.0 * np.pi) - np.pi
    return {"delta_s_mm": 1e3 * distance, "delta_heading_deg": np.degrees(turned)}


def worst(commands: Commands) -> Commands:
    """Return the commands with the drive lasting half a frame more than whole frames."""
    t_s = commands.t_s.copy()
    frames = np.floor((t_s[-1] - t_s[-2]) / FRAME_S)
    t_s[-1] = t_s[-2] + (frames + 0.5) * FRAME_S
    return Commands(t_s, commands.drive, commands.front, commands.rear)


def rides(version: str) -> dict[int, dict[str, dict[str, Floats]]]:
    """Return the errors of rides at evenly spread phases, by trajectory and by the clock that timed them."""
    rig, model, found = Rides(version), nominal_vehicle(), {}
    for case, target in CASES.items():
        commands = plan(load_trajectory(str(case)), model, workspace=None).commands
        found[case] = {"worst": errors_of(rig.ends(worst(commands), PHASES), target)}
        if version == "2":
            found[case]["on board"] = errors_of(rig.ends(commands, PHASES, on_board=True), target)
    rig.close()
    return found


def spreads(errors: dict[str, pd.DataFrame], ridden: dict[int, dict[str, dict[str, Floats]]]) -> None:
    """Print standard deviations with their intervals, and the largest share of the thesis' variance they can be."""
    thesis = thesis_sd()
    for quantity, unit in QUANTITIES.items():
        arms = "".join(f"{f'firmware {arm}' if arm != 'none' else 'no firmware':>22s}" for arm in ARMS)
        print(f"\nstandard deviation of {unit} between repeats [95 %]\n   {arms}{'on board':>10s}{'worst':>8s}", end="")
        print(f"{'thesis':>8s}{'share of its variance: as planned, at worst':>46s}")
        planned, at_all = [], []
        for case in CASES:
            measured = {arm: sd_interval(_values(table, case, quantity)) for arm, table in errors.items()}
            cells = "".join(f"{sd:9.3f} [{low:4.2f}, {high:4.2f}]" for sd, low, high in measured.values())
            on_board, at_worst = (float(ridden[case][how][quantity].std()) for how in ("on board", "worst"))
            published = thesis[case, quantity]
            planned.append(max(measured[arm][0] for arm in ("1", "2")) ** 2)
            at_all.append(at_worst**2)
            percent = "".join(f"{100.0 * variances[-1] / published**2:12.1f} %" for variances in (planned, at_all))
            print(f"{case:3d}{cells}{on_board:10.3f}{at_worst:8.3f}{published:8.2f}{percent}")
        whole = sum(thesis[case, quantity] ** 2 for case in CASES)
        percent = "".join(f"{100.0 * sum(variances) / whole:12.1f} %" for variances in (planned, at_all))
        print(f"of all variances together{percent}")


def explains_all(ridden: dict[int, dict[str, dict[str, Floats]]]) -> None:
    """Print over how many ms each command's delay would have to vary to make all of the thesis' spread.

    Two delays that vary evenly over w differ by w / √6 (standard deviation), those of a frame by half of it at most.
    """
    print("\na delay that varies evenly over so many ms would make the thesis' spread")
    for (case, quantity), published in thesis_sd().items():
        per_ms = float(ridden[case]["worst"][quantity].std()) / (0.5e3 * FRAME_S)
        needed = f"{published / per_ms * 6.0**0.5:6.0f} ms" if per_ms > 1e-3 else "none does"
        print(f"{case:3d} {QUANTITIES[quantity]:8s}{needed:>12s}")


def _values(table: pd.DataFrame, case: int, quantity: str) -> Floats:
    rows = table[table["trajectory"].str.startswith(f"{case}") & (table["status"] == "ok")]
    values: Floats = rows[quantity].to_numpy(dtype=float)
    return values


def main() -> int:
    """Drive, compare, print; return 2 where that cannot be."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--repeats", type=int, default=20, metavar="N")
    parser.add_argument("--out", type=Path, metavar="DIR")
    arguments, _ = parser.parse_known_args()

    def measure() -> None:
        folder = arguments.out or Path(tempfile.mkdtemp(prefix="agvbench-firmware-"))
        folder.mkdir(parents=True, exist_ok=True)
        nominal_vehicle().save(vehicle := folder / "vehicle.toml")
        campaigns = drive(folder, vehicle, arguments.repeats)
        print("\n── firmware 1 against firmware 2", flush=True)
        agvbench("compare", str(campaigns["1"]), str(campaigns["2"]), "--fail-on=never")
        ridden = rides("2")
        spreads({arm: pose_errors(Campaign.open(path)) for arm, path in campaigns.items()}, ridden)
        explains_all(ridden)

    return exit_code(measure)


if __name__ == "__main__":
    sys.exit(main())
