"""The plant contract: what every plant must do, as checks that anybody can run on their own.

Each clause is one function of a `Subject`; `CLAUSES` names them all. A clause asks for nothing beyond the plant
protocol (`agvbench.types.Plant`): plants may slip, lag, wear and drift.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from agvbench.errors import PlantError
from agvbench.simulator.checked_plant import CheckedPlant
from agvbench.simulator.plant_loading import CheckedFactory, load_plant
from agvbench.types import CommandUnit, PlantFactory, wrap_angle

REST_TOLERANCE_M = 1e-3
SPLIT_TOLERANCE_M = 5e-3
FASTEST_MPS = 20.0
STEP_S = 1.0 / 120.0
START = (0.4, -0.3, 2.0)
POSE = tuple[float, float, float]


@dataclass(frozen=True)
class Subject:
    """A factory under test, with the commands that its plants understand."""

    factory: CheckedFactory
    neutral: float
    span: float

    def plant(self, seed: int = 3) -> CheckedPlant:
        """Return a fresh plant at rest at `START`."""
        plant = self.factory(seed)
        plant.reset(START, seed=5)
        return plant

    def drive(self, plant: CheckedPlant, drive: float, front: float, rear: float, dt: float) -> POSE:
        """Hold a command given in shares of the range, −1…1."""
        low, span = self.neutral, self.span
        return plant.advance(low + span * drive, low + span * front, low + span * rear, dt)

    def route(self, plant: CheckedPlant) -> list[POSE]:
        """Drive a short route; return its poses."""
        shares = ((-1.0, 0.2, -0.1), (1.0, -0.5, 0.3), (0.5, 0.0, 0.4), (0.0, 0.0, 0.0))
        return [self.drive(plant, *share, STEP_S) for share in shares for _ in range(30)]


def _distance(a: POSE, b: POSE) -> float:
    return math.hypot(a[0] - b[0], a[1] - b[1])


def _near(pose: POSE, wanted: POSE, tolerance_m: float) -> bool:
    turned = abs(wrap_angle(pose[2] - wanted[2]))
    return _distance(pose, wanted) <= tolerance_m and turned <= 10.0 * tolerance_m


def _demand(kept: bool, what: str, value: object = None, limit: object = None, remedy: str | None = None) -> None:
    if not kept:
        raise PlantError(what, value=value, limit=limit, remedy=remedy)


def stays_where_it_is_put(subject: Subject) -> None:
    """At neutral, a vehicle that was reset stays at its pose: within 1 mm after 1 s."""
    plant = subject.plant()
    for dt in (0.001, 0.999):
        pose = subject.drive(plant, 0.0, 0.0, 0.0, dt)
        _demand(
            _near(pose, START, REST_TOLERANCE_M), "vehicle at neutral left the pose it was put at",
            value=f"({pose[0]:.3f}, {pose[1]:.3f}, {pose[2]:.3f})", limit=f"within 1 mm of {START}",
            remedy="reset to pose and to rest; is neutral right for this command unit?",
        )  # fmt: skip


def reset_stops_it(subject: Subject) -> None:
    """Reset, even in full motion, leaves nothing of the motion."""
    plant = subject.plant()
    for share in (-1.0, 1.0):
        subject.drive(plant, share, 0.5, -0.5, 1.0)
        plant.reset(START, seed=6)
        pose = subject.drive(plant, 0.0, 0.0, 0.0, 0.5)
        _demand(
            _near(pose, START, REST_TOLERANCE_M), "vehicle moved on after a reset in motion",
            value=f"{1e3 * _distance(pose, START):.1f} mm", limit="1 mm", remedy="let reset clear speeds",
        )  # fmt: skip


def same_seed_same_plant(subject: Subject) -> None:
    """Equal seeds and equal calls give equal poses, bit for bit."""
    first, second = (subject.route(subject.plant()) for _ in range(2))
    at = next((i for i, (a, b) in enumerate(zip(first, second, strict=True)) if a != b), None)
    _demand(
        at is None, "two plants of one seed answered differently", value=f"call {at}",
        remedy="take all randomness from the seeds, none from time or global state",
    )  # fmt: skip


def plants_share_nothing(subject: Subject) -> None:
    """Driving one plant does not move another."""
    alone = subject.route(subject.plant())
    one, other = subject.plant(), subject.plant(seed=4)
    subject.route(other)
    _demand(
        subject.route(one) == alone, "driving one plant changed another",
        remedy="keep the state in the object, not in the module or class",
    )  # fmt: skip


def stands_every_command(subject: Subject) -> None:
    """Every corner of the command range has a finite answer."""
    plant = subject.plant()
    for drive in (-1.0, 0.0, 1.0):
        for front in (-1.0, 0.0, 1.0):
            for rear in (-1.0, 0.0, 1.0):
                subject.drive(plant, drive, front, rear, 0.25)


def takes_every_time_step(subject: Subject) -> None:
    """Time steps from 0.1 ms to 10 s have finite answers."""
    plant = subject.plant()
    for dt in (1e-4, 1.0 / 240.0, STEP_S, 0.033, 0.1, 1.0, 10.0):
        subject.drive(plant, -1.0, 0.3, -0.3, dt)


def time_adds_up(subject: Subject) -> None:
    """One second in 120 calls and one second in one call end within 5 mm."""
    many, one = subject.plant(), subject.plant()
    pose: POSE = START
    for _ in range(120):
        pose = subject.drive(many, -1.0, 0.3, -0.2, STEP_S)
    apart = _distance(pose, subject.drive(one, -1.0, 0.3, -0.2, 1.0))
    _demand(
        apart <= SPLIT_TOLERANCE_M, "one second in 120 calls ends elsewhere than in one call",
        value=f"{1e3 * apart:.1f} mm apart", limit="5 mm", remedy="integrate over dt in small steps of your own",
    )  # fmt: skip


def moves_without_jumps(subject: Subject) -> None:
    """No step is faster than 20 m/s."""
    plant, last = subject.plant(), START
    for pose in subject.route(plant):
        speed = _distance(pose, last) / STEP_S
        _demand(
            speed <= FASTEST_MPS, "vehicle jumped", value=f"{speed:.0f} m/s", limit=f"{FASTEST_MPS:.0f} m/s",
            remedy="return metres; sensor noise belongs to the camera",
        )  # fmt: skip
        last = pose


def obeys_drive(subject: Subject) -> None:
    """Full drive in one direction or the other moves the vehicle by 10 mm in 2 s."""
    plant, moved = subject.plant(), 0.0
    for share in (-1.0, 1.0):
        moved = max(moved, _distance(subject.drive(plant, share, 0.0, 0.0, 2.0), START))
    _demand(
        moved >= 0.01, "vehicle did not move under full drive", value=f"{1e3 * moved:.1f} mm", limit="at least 10 mm",
        remedy="check the command unit (us: 900 to 2100, normalised: -1 to 1)",
    )  # fmt: skip


CLAUSES: Mapping[str, Callable[[Subject], None]] = MappingProxyType(
    {
        clause.__name__: clause
        for clause in (
            stays_where_it_is_put, reset_stops_it, same_seed_same_plant, plants_share_nothing, stands_every_command,
            takes_every_time_step, time_adds_up, moves_without_jumps, obeys_drive,
        )
    }
)  # fmt: skip


def subject_of(factory: PlantFactory | str, command_unit: CommandUnit = "us") -> Subject:
    """Return a factory, or what `load_plant` takes, ready to be checked."""
    if isinstance(factory, str):
        checked = load_plant(factory)
    else:
        checked = CheckedFactory(factory, getattr(factory, "__name__", type(factory).__name__))
    neutral, span = (1500.0, 600.0) if command_unit == "us" else (0.0, 1.0)
    return Subject(checked, neutral, span)


def check_plant(factory: PlantFactory | str, *, command_unit: CommandUnit = "us") -> None:
    """Check that a factory's plants keep the plant contract.

    Parameters
    ----------
    factory
        A function of a seed that returns a plant, or its name as for `agvbench.simulator.load_plant`.
    command_unit
        ``"us"``: 900…2100, neutral 1500; ``"normalised"``: −1…1, neutral 0.

    Raises
    ------
    PlantError
        On the first clause that is broken; the line names plant and clause.

    Examples
    --------
    In a test of your own::

        def test_my_plant():
            check_plant("lab/my_plant.py:make_plant")

    >>> from agvbench.simulator import make_plant
    >>> check_plant(make_plant)
    """
    subject = subject_of(factory, command_unit)
    for name, clause in CLAUSES.items():
        try:
            clause(subject)
        except PlantError as error:
            where = subject.factory.name if error.where is None else error.where
            raise PlantError(
                f"[{name}] {error.what}", where=where, value=error.value, limit=error.limit, remedy=error.remedy
            ) from error
