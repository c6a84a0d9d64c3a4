"""Whether ``agvbench diagnose`` finds the delay that the firmware makes, and as long as it is.

`firmware_vehicle` equals what static maps can say, so that nothing but the firmware (and the camera's noise) is left
to find. It is driven through the whole loop: with either version, with the benchmarks that a session drives by itself
and with more, without variation between runs and with one like that of the thesis' vehicle. Beside what is found stands
what was measured of the same firmware: the delay from a command's first bit to the end of the first pulse it made.

``--only WORD`` takes the campaigns whose name has the word; needs ``nox -s firmware``.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from firmware_needed import exit_code
from perf_firmware import CHANNELS, commands, respond
from perf_firmware_compare import PROGRAM

from agvbench.campaign import Campaign
from agvbench.diagnosis import diagnose

if TYPE_CHECKING:
    from agvbench.diagnosis import Diagnosis

SESSION = ("calibration", "trajectories")
MORE = (*SESSION, "step_response", "free_driving")
QUIET, SCATTERING = "make_plant", "make_scattering_plant"
MEASURED_COMMANDS, REPEATS = 1000, 5


@dataclass(frozen=True)
class Case:
    """A campaign: which firmware (None: none), what is driven, and which factory of `firmware_vehicle` drives."""

    name: str
    version: str | None
    benchmarks: tuple[str, ...] = MORE
    plant: str = QUIET


CASES = (
    Case("no firmware", None),
    Case("firmware 1", "1"),
    Case("firmware 2", "2"),
    Case("firmware 2, calibration and the eight only", "2", SESSION),
    Case("firmware 2, variation as the thesis' vehicle", "2", MORE, SCATTERING),
)


def driven(case: Case, folder: Path) -> Campaign:
    """Drive a campaign that calibrates the vehicle first, as a session does."""
    agv = "sim" if case.version is None else f"simavr:{case.version}"
    plant = f"{Path(__file__).with_name('firmware_vehicle.py')}:{case.plant}"
    options = [f"--agv={agv}", "--mocap=natnet:emulated", f"--plant={plant}", f"--repeats={REPEATS}", "--no-report"]
    command = [sys.executable, "-c", PROGRAM, "bench", *case.benchmarks, *options, f"--out={folder}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603  (our own program)
    if done.returncode not in {0, 1}:
        sys.exit(done.stderr)
    return Campaign.open(folder)


def measured_ms() -> dict[str, list[float]]:
    """Return the mean delay of drive, front and rear [ms] by version."""
    found = {}
    for version in ("1", "2"):
        delays, _, _ = respond(version, commands(MEASURED_COMMANDS))
        found[version] = [float(one) for one in delays.mean(axis=0)]
        means = ", ".join(f"{name} {mean:.1f}" for name, mean in zip(CHANNELS, found[version], strict=True))
        print(f"firmware {version}, mean delay of {MEASURED_COMMANDS} commands [ms]: {means}", flush=True)
    return found


def report(case: Case, found: Diagnosis) -> None:
    """Print the answer."""
    print(f"{case.name}: {found.verdict}", flush=True)
    for effect in found.effects:
        sizes = ", ".join(f"{n} {p.value:.5f} ± {p.stderr:.5f}" for n, p in effect.parameters.items())
        alternatives = f"; or instead {', '.join(effect.confounded_with)}" if effect.confounded_with else ""
        print(f"    {effect.name}: {sizes}{alternatives}")
    for name, errors in (found.held_out.errors if found.held_out else {}).items():
        before, after, floor = (errors.get(key, float("nan")) for key in ("before", "after", "floor"))
        print(f"    {name:20s} before {before:6.2f}, after {after:6.2f}, floor {floor:6.2f}")
    for dependence in found.depends_on:
        print(f"    depends on {dependence.covariate}")


def main() -> int:
    """Measure, drive, diagnose, print; return 2 where that cannot be."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--only", default="", metavar="WORD")
    arguments, _ = parser.parse_known_args()

    def measure() -> None:
        measured_ms()
        for case in (case for case in CASES if arguments.only in case.name):
            with tempfile.TemporaryDirectory(prefix="agvbench-firmware-") as folder:
                report(case, diagnose(driven(case, Path(folder) / "campaign")))

    return exit_code(measure)


if __name__ == "__main__":
    sys.exit(main())
