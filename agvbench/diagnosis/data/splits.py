"""Groups of runs with the same commands, and the split into training, validation and test runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.criteria import DATA
from agvbench.errors import FitError
from agvbench.types import Command, Commands, Floats, Run

_SAME_TIME_S = 0.05
_SAME_LEVEL = 1e-5
# Of the share that is to be drawn: with less, ends of ranges may lose groups.
_ENOUGH = 0.75
# Of that share, too: with less, levels that are near each other count as one.
_TOO_FEW = 0.4
_ROLES = ("drive", "front", "rear")
# Where nearly every group has levels of its own, those near the same one of this number of levels count as one.
_COARSE_LEVELS = 16


def with_common_levels(runs: Sequence[Run]) -> Sequence[Run]:
    """Return the runs with command levels merged that differ by rounding only.

    For example, 0.15 and 0.15000000000000002 are one level. As two levels they would be two nodes of a map, and one of
    them might not occur in any training run.
    """
    levels = {role: _common([getattr(run.commands, role) for run in runs]) for role in _ROLES}
    if not any(len(values) for values, _ in levels.values()):
        return runs
    out = []
    for run in runs:
        snapped = {}
        for role, (known, common) in levels.items():
            values = getattr(run.commands, role)
            snapped[role] = common[np.searchsorted(known, values)] if len(known) and len(values) else values
        out.append(replace(run, commands=replace(run.commands, **snapped)))
    return out


def _common(commands: list[Floats]) -> tuple[Floats, Floats]:
    """Return all levels, ascending, and the common level that replaces each; both empty if no levels are close."""
    levels = np.unique(np.concatenate([np.empty(0), *commands]))
    if len(levels) < 2:
        return levels[:0], levels[:0]
    near = np.diff(levels) <= _SAME_LEVEL * (levels[-1] - levels[0])
    if not near.any():
        return levels[:0], levels[:0]
    first = np.flatnonzero(np.r_[True, ~near])
    return levels, levels[first[np.cumsum(np.r_[True, ~near]) - 1]]


def group_runs(runs: Sequence[Run]) -> NDArray[np.int64]:
    """Return the group number of each run, (R,): runs with the same commands, within 50 ms, form a group."""
    groups: list[tuple[Commands, int]] = []
    by_rows: dict[bytes, list[tuple[Commands, int]]] = {}
    numbers = np.empty(len(runs), dtype=np.int64)
    for i, run in enumerate(runs):
        c = run.commands
        alike = by_rows.setdefault(np.column_stack([c.drive, c.front, c.rear]).round(9).tobytes(), [])
        found = next((n for other, n in alike if np.all(np.abs(other.t_s - c.t_s) <= _SAME_TIME_S)), None)
        if found is None:
            found = len(groups)
            groups.append((c, found))
            alike.append(groups[-1])
        numbers[i] = found
    return numbers


_Shown = tuple[str, float | str]
"""What a run shows of a command: one of its levels, or a kind of change."""


@dataclass(frozen=True)
class Split:
    """Masks of the training, validation and test runs, (R,) each.

    Models are fitted to ``training`` runs. ``validation`` runs accept or reject the selected model. The published
    errors come from the ``test`` runs, which are opened once, at the end.
    """

    training: NDArray[np.bool_]
    validation: NDArray[np.bool_]
    test: NDArray[np.bool_]

    @property
    def names(self) -> list[str]:
        """The values of a campaign's column ``split`` for each run."""
        return [
            "held_out" if t else "validation" if v else "fit" for t, v in zip(self.test, self.validation, strict=True)
        ]


def with_other_validation(
    split: Split, runs: Sequence[Run], group: NDArray[np.int64], neutral: Command, seed: int
) -> Split | None:
    """Return the split with other runs for validation, and the present ones among the training runs; None if none can.

    The test runs stay. Validation runs that a campaign names itself stay, too.
    """
    if not split.validation.any() or any(run.split for run in runs):
        return None
    validation = _for_validation(runs, group, neutral, split.training, np.random.default_rng([0x0A6A, seed]))
    return Split(~(split.test | validation), validation, split.test)


def split_runs(runs: Sequence[Run], group: NDArray[np.int64], neutral: Command, seed: int) -> Split:
    """Split runs into training, validation and test runs.

    A campaign's own ``split`` column takes precedence. If it names no validation runs, an eighth of its training runs
    is drawn at random for validation.

    Otherwise whole groups are drawn at random, about a quarter of all runs: half of them for validation and half for
    test. A group is drawn only if every level of every command in it also occurs in a remaining group. The test then
    evaluates new combinations of known commands and not the interpolation of a map. Two groups with each end of a
    command's range remain, as far as enough runs can be drawn otherwise: a single combination with other commands does
    not determine the end of a map. The same holds for every kind of change while the vehicle drives, such as a return
    to neutral: a backlash, which only returns show, would otherwise be found by the test alone. At most a third of the
    runs that steer while they drive is drawn: they are few, and no other run shows a dependence on the steering
    history. Where nearly every group has levels of its own, those near the same sixteenth of the range of a command
    with many levels count as one, and the test includes interpolation. If only a single run can be spared, it is the
    test run, and there is no validation.

    Raises
    ------
    FitError
        If the campaign has no training runs, or no test runs.
    """
    split, rng = np.array([run.split or "" for run in runs]), np.random.default_rng([0xD1A6, seed])
    if not np.any(split != ""):
        held = _drawn(runs, group, neutral, rng, DATA.test_share)
        test = _for_test(runs, group, neutral, held)
        return Split(~held, held & ~test, test)
    test, validation = split == "held_out", split == "validation"
    training = ~(test | validation)
    if not training.any() or not test.any():
        named = {run.split for run in runs}
        raise FitError("the column split must name training runs and test runs", where="runs", value=named)
    if not validation.any():
        validation = _for_validation(runs, group, neutral, training, rng)
    return Split(training & ~validation, validation, test)


def _for_validation(
    runs: Sequence[Run],
    group: NDArray[np.int64],
    neutral: Command,
    training: NDArray[np.bool_],
    rng: np.random.Generator,
) -> NDArray[np.bool_]:
    """Return which runs (R,) are drawn for validation from the `training` runs (R,): an eighth of them."""
    rest, validation = np.flatnonzero(training), np.zeros_like(training)
    drawn = _drawn([runs[int(i)] for i in rest], group[rest], neutral, rng, DATA.test_share / 2.0)
    validation[rest[drawn]] = True
    return validation


def _for_test(
    runs: Sequence[Run], group: NDArray[np.int64], neutral: Command, held: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which of the drawn runs `held` (R,) are test runs: every other group, or every other run of one group."""
    test, validation = np.zeros_like(held), np.zeros_like(held)
    parts = [np.flatnonzero(held & (group == g)) for g in np.unique(group[held])]
    if len(parts) == 1:
        parts = list(parts[0][:, None])
    # Runs that steer while they drive come first, so that both halves contain some.
    for own in sorted(parts, key=lambda own: not _steers_while_driving(runs[own[0]].commands, neutral)):
        (test if np.count_nonzero(test) <= np.count_nonzero(validation) else validation)[own] = True
    return test


def _drawn(
    runs: Sequence[Run], group: NDArray[np.int64], neutral: Command, rng: np.random.Generator, share: float
) -> NDArray[np.bool_]:
    """Return which runs (R,) are drawn: those of whole groups, or some repeats if no group can be spared.

    Two groups with each end of a command's range remain. Where that leaves few runs to draw, an end that only two have
    may lose one of them. If hardly any run can be drawn, near levels count as one: the maps between them are then
    tested, too, which errs more than the model where levels are few.
    """
    order = rng.permutation(np.unique(group)).tolist()
    commands = {g: runs[int(np.argmax(group == g))].commands for g in order}
    levels = _levels(commands)
    held = _as_many(group, commands, levels, neutral, share)
    if np.count_nonzero(held) < _TOO_FEW * share * len(runs):
        held = _as_many(group, commands, _near_levels(levels), neutral, share)
    return held if held.any() else _some_repeats(group, rng)


def _as_many(
    group: NDArray[np.int64],
    commands: Mapping[int, Commands],
    levels: Mapping[int, set[_Shown]],
    neutral: Command,
    share: float,
) -> NDArray[np.bool_]:
    """Return which runs (R,) are drawn; an end that only two groups have loses one of them if there are few others."""
    held = _drawn_groups(group, commands, levels, neutral, share, 2)
    if np.count_nonzero(held) >= _ENOUGH * share * len(group):
        return held
    return _drawn_groups(group, commands, levels, neutral, share, 3)


def _drawn_groups(
    group: NDArray[np.int64],
    commands: Mapping[int, Commands],
    levels: Mapping[int, set[_Shown]],
    neutral: Command,
    share: float,
    fewest: int,
) -> NDArray[np.bool_]:
    """Return which runs (R,) the groups contain that can be drawn in the order of `commands`.

    Of an end of a range that at least `fewest` groups have, two remain.
    """
    shown = {g: levels[g] | _changes_while_driving(own, neutral) for g, own in commands.items()}
    uses = Counter(one for own in shown.values() for one in own)
    ends = _ends(levels.values())
    least = {one: 2 if one in ends and count >= fewest else 1 for one, count in uses.items()}
    steering = np.isin(group, [g for g, own in commands.items() if _steers_while_driving(own, neutral)])
    held = np.zeros(len(group), dtype=np.bool_)
    for g in commands:
        own = group == g
        if np.count_nonzero(held) + np.count_nonzero(own) > 1.1 * share * len(group):
            continue
        if steering[own].any() and np.count_nonzero(held & steering) + np.count_nonzero(own) > np.sum(steering) / 3.0:
            continue
        if all(uses[one] > least[one] for one in shown[g]):
            held |= own
            uses.subtract(shown[g])
    return held


def _some_repeats(group: NDArray[np.int64], rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return a quarter of the repeats of each group, for campaigns that cannot spare a whole group."""
    held = np.zeros(len(group), dtype=np.bool_)
    for g in np.unique(group):
        own = np.flatnonzero(group == g)
        if len(own) >= 2:
            held[rng.permutation(own)[: max(1, len(own) // 4)]] = True
    return held


def _steers_while_driving(commands: Commands, neutral: Command) -> bool:
    return any(role != "drive" for role, _ in _changes_while_driving(commands, neutral))


def _changes_while_driving(commands: Commands, neutral: Command) -> set[_Shown]:
    """Return how each channel changes between commands that drive: from neutral, to it, through it, or beside it."""
    drives = commands.drive != neutral.drive
    found: set[_Shown] = set()
    for role in _ROLES:
        values = getattr(commands, role)
        changes = np.flatnonzero(drives[1:] & drives[:-1] & (np.diff(values) != 0.0))
        side = np.sign(values - getattr(neutral, role))
        for before, after in zip(side[changes], side[changes + 1], strict=True):
            beside = "through neutral" if before * after < 0.0 else "beside neutral"
            found.add((role, "from neutral" if before == 0.0 else "to neutral" if after == 0.0 else beside))
    return found


def _levels(commands: Mapping[int, Commands]) -> dict[int, set[_Shown]]:
    """Return the levels of every command by group."""
    return {
        g: {(role, float(v)) for role in _ROLES for v in np.unique(getattr(own, role))} for g, own in commands.items()
    }


def _near_levels(levels: Mapping[int, set[_Shown]]) -> dict[int, set[_Shown]]:
    """Return the nearest of the levels that divide each range evenly, by group, and the ends of the range.

    The ends count by themselves, so that no map is extrapolated. A command with few levels keeps its own: maps between
    them are not known.
    """
    every = set[_Shown]().union(*levels.values())
    near: dict[_Shown, set[_Shown]] = {}
    for role in _ROLES:
        own = sorted(float(level) for of, level in every if of == role)
        if len(own) <= 2 * _COARSE_LEVELS:
            near |= {(role, level): {(role, level)} for level in own}
            continue
        step = (own[-1] - own[0]) / (_COARSE_LEVELS - 1)
        near |= {(role, level): {(role, own[0] + step * round((level - own[0]) / step))} for level in own}
        near[role, own[0]].add((role, "lowest"))
        near[role, own[-1]].add((role, "highest"))
    return {g: set[_Shown]().union(*(near[one] for one in own)) for g, own in levels.items()}


def _ends(levels: Iterable[set[_Shown]]) -> set[_Shown]:
    """Return the lowest and the highest level of each command."""
    every = set[_Shown]().union(*levels)
    by_role = [[one for one in every if one[0] == role and isinstance(one[1], float)] for role in _ROLES]
    return {end for own in by_role if own for end in (min(own), max(own))}


def folds(group: NDArray[np.int64], count: int, seed: int) -> NDArray[np.int64]:
    """Return the fold of each run, (R,): a group is in one fold, and the folds are of about equal size."""
    names, sizes = np.unique(group, return_counts=True)
    order = np.random.default_rng([0xF01D, seed]).permutation(len(names))
    order = order[np.argsort(-sizes[order], kind="stable")]
    load, fold_of = np.zeros(count, dtype=np.int64), {}
    for k in order:
        fold_of[int(names[k])] = int(np.argmin(load))
        load[fold_of[int(names[k])]] += sizes[k]
    return np.array([fold_of[int(g)] for g in group], dtype=np.int64)
