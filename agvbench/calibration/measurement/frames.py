"""Frames that can be measured from, and the count of those that cannot."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.signals import best_chain
from agvbench.types import Floats, Frames, wrap_angle

# A frame that arrives this much behind later ones is late; further behind, its time stamp is wrong.
_LATEST_S = 1.0
# The path may be this many times as fast as the vehicle usually is, and deviate by this many standard deviations.
_SPEED_MARGIN = 3.0
_NOISE_MARGIN = 8.0
_SLOWEST_LIMIT_MPS = 0.5
_SLOWEST_LIMIT_RADPS = 3.0
# A step that stays, with this much of the path before and after it, is the vehicle's own if it is no larger.
_KICK_S, _KICK_M, _KICK_RAD = 0.25, 0.05, 0.1
_FARTHEST = 1e6  # m or rad: numbers beyond are no poses
_LONGEST_S = 1e12
_PIECES = 1000  # a piece of the path is linked to one of so many before it


@dataclass(frozen=True)
class FrameQuality:
    """What `clean_frames` found: counts of frames unless said otherwise.

    ``frames`` received; ``kept``; ``untracked`` (no pose); ``doubled`` (a capture time, or frame number, seen before);
    ``late`` (arrived after a later one: put in order and kept); ``bad_time`` (time not finite, or more than a
    second behind); ``jumps`` (poses that the vehicle cannot have had); ``lost`` (missing between those received,
    at the usual period); ``gaps`` between frames kept, of one missing frame or more; ``longest_gap_s``;
    ``tracked_share`` of the frames that the camera took, lost ones included, that were kept.
    """

    frames: int
    kept: int
    untracked: int
    doubled: int
    late: int
    bad_time: int
    jumps: int
    lost: int
    gaps: int
    longest_gap_s: float
    tracked_share: float


def clean_frames(frames: Frames, *, max_speed_mps: float | None = None) -> Frames:
    """Return the frames that show the vehicle, in order of capture, each once.

    Untracked and doubled frames and those with an impossible time go; late frames go where they belong. Wildly
    wrong poses (a tracker that jumps metres for a frame or for many, or takes the body the wrong way round) are
    recognised by what the vehicle can do: the kept poses are the longest chain in which each follows from the one
    before at no more than `max_speed_mps`, give or take noise, and with a turn to match. A small step after which the
    path goes on from there, such as a seam of the floor makes, is no jump.

    Parameters
    ----------
    frames
        In order of arrival.
    max_speed_mps
        Fastest plausible motion. By default three times the highest speed that the frames themselves show for
        0.4 s (in the median, so that wrong frames do not count), and at least 0.5 m/s.
    """
    return inspect_frames(frames, max_speed_mps=max_speed_mps)[0]


def inspect_frames(frames: Frames, *, max_speed_mps: float | None = None) -> tuple[Frames, FrameQuality]:
    """Return what `clean_frames` does, and the counts of what was found."""
    pose_known = np.all([np.abs(c) < _FARTHEST for c in (frames.x_m, frames.y_m, frames.heading_rad)], axis=0)
    bad_time, late = _check_times(frames.t_s)
    order = np.argsort(frames.t_s, kind="stable")
    order = order[~bad_time[order]]
    doubled = _repeats(frames, order)
    distinct = order[~doubled]
    seen = distinct[(frames.tracked & pose_known)[distinct]]
    right = _longest_chain(frames.select(seen), max_speed_mps)
    kept = frames.select(seen[right])
    times = frames.t_s[distinct]
    period = max(float(np.median(np.diff(times))), 1e-6) if len(times) > 1 else np.nan
    taken = round(float(np.sum(np.maximum(np.round(np.diff(times) / period), 1)))) + 1 if len(times) > 1 else len(times)
    steps = np.diff(kept.t_s)
    return kept, FrameQuality(
        frames=len(frames),
        kept=len(kept),
        untracked=len(distinct) - len(seen),
        doubled=int(np.count_nonzero(doubled)),
        late=int(np.count_nonzero(late)),
        bad_time=int(np.count_nonzero(bad_time)),
        jumps=len(seen) - len(kept),
        lost=max(taken - len(distinct), 0),
        gaps=int(np.count_nonzero(steps > 1.5 * period)),
        longest_gap_s=float(np.max(steps, initial=0.0)),
        tracked_share=len(kept) / taken if taken else 0.0,
    )


def _check_times(t_s: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which times are unusable and which frames are merely late.

    The frames in order are the longest rising sequence of times, so that a single time far ahead does not make all that
    follow look late.
    """
    finite = np.abs(t_s) < _LONGEST_S
    index = np.flatnonzero(finite)
    in_order = np.zeros(len(t_s), dtype=np.bool_)
    in_order[index[_longest_rising(t_s[index])]] = True
    if not in_order.any():
        return ~finite, in_order
    newest = np.maximum.accumulate(np.where(in_order, t_s, np.min(t_s[in_order])))
    out = finite & ~in_order
    late = out & (np.abs(np.where(finite, t_s, np.inf) - newest) <= _LATEST_S)
    return ~finite | (out & ~late), late


def _longest_rising(values: Floats) -> NDArray[np.int64]:
    """Return the indices of the longest sequence that does not fall.

    Where no value that follows is smaller than any before, the sequence can be cut: what is out of order is sorted out
    in its own short piece, so that a late frame does not cost a walk along the whole run.
    """
    if len(values) < 2:
        return np.arange(len(values))
    smallest_after = np.minimum.accumulate(values[::-1])[::-1][1:]
    cuts = np.flatnonzero(np.maximum.accumulate(values)[:-1] <= smallest_after) + 1
    begins, ends = np.r_[0, cuts], np.r_[cuts, len(values)]
    chosen = np.ones(len(values), dtype=np.bool_)
    for begin, end in zip(begins[ends - begins > 1], ends[ends - begins > 1], strict=True):
        chosen[begin:end] = False
        chosen[begin + _longest_in_piece(values[begin:end])] = True
    return np.flatnonzero(chosen)


def _longest_in_piece(values: Floats) -> NDArray[np.int64]:
    """Return the indices of the longest sequence that does not fall (patience sorting, n log n)."""
    tails: list[float] = []
    tail_index: list[int] = []
    previous = np.full(len(values), -1)
    for i, value in enumerate(values.tolist()):
        place = bisect_right(tails, value)
        previous[i] = tail_index[place - 1] if place else -1
        if place == len(tails):
            tails.append(value)
            tail_index.append(i)
        else:
            tails[place], tail_index[place] = value, i
    chain, i = [], tail_index[-1]
    while i >= 0:
        chain.append(i)
        i = int(previous[i])
    return np.array(chain[::-1])


def _repeats(frames: Frames, order: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which frames, in `order`, repeat a capture time or a known frame number."""
    repeated = np.zeros(len(order), dtype=np.bool_)
    repeated[1:] = np.diff(frames.t_s[order]) == 0.0
    number = frames.frame[order]
    known = np.flatnonzero((number >= 0) & ~repeated)
    _, first = np.unique(number[known], return_index=True)
    again = np.ones(len(known), dtype=np.bool_)
    again[first] = False
    # A frame counter that restarts is no repetition: the same number must come with nearly the same time.
    first_time = dict(zip(number[known[first]].tolist(), frames.t_s[order[known[first]]].tolist(), strict=True))
    for k in known[again]:
        repeated[k] = abs(frames.t_s[order[k]] - first_time[int(number[k])]) < _LATEST_S
    return repeated


def _longest_chain(frames: Frames, max_speed_mps: float | None) -> NDArray[np.int64]:
    """Return the indices of the longest chain of poses that follow from one another."""
    if len(frames) < 2:
        return np.arange(len(frames))
    positions = np.column_stack([frames.x_m, frames.y_m])
    headings = np.unwrap(frames.heading_rad)
    speed, noise_m = _limits(frames.t_s, positions, max_speed_mps, _SLOWEST_LIMIT_MPS)
    yaw, turn = _limits(frames.t_s, headings[:, None], None, _SLOWEST_LIMIT_RADPS)

    def follows(
        earlier: NDArray[np.int64], later: NDArray[np.int64] | int, kicked: NDArray[np.bool_] | bool = False
    ) -> NDArray[np.bool_]:
        dt = frames.t_s[later] - frames.t_s[earlier]
        moved = np.hypot(*(positions[later] - positions[earlier]).T) - np.where(kicked, _KICK_M, 0.0)
        turned = np.abs(wrap_angle(headings[later] - headings[earlier]))
        turned -= np.where(kicked, _KICK_RAD, 0.0)
        return np.asarray((moved <= speed * dt + noise_m) & (turned <= yaw * dt + turn))

    every = np.arange(len(frames))
    breaks = np.flatnonzero(~follows(every[:-1], every[1:])) + 1
    if not len(breaks):
        return every
    starts, ends = np.r_[0, breaks], np.r_[breaks, len(frames)]
    lasting = frames.t_s[ends - 1] - frames.t_s[starts] >= _KICK_S

    def linked(before: slice, piece: int) -> NDArray[np.bool_]:
        """Return whether a piece's first pose follows from the last ones of those before it."""
        return follows(ends[before] - 1, int(starts[piece]), lasting[before] & lasting[piece])

    chain = best_chain((ends - starts).astype(np.int64), linked, _PIECES)
    return np.concatenate([np.arange(starts[piece], ends[piece]) for piece in chain])


def _limits(t_s: Floats, values: Floats, fastest: float | None, at_least: float) -> tuple[float, float]:
    """Return the fastest plausible change [per s] and the distance that noise may add, read from the values."""
    bend = np.linalg.norm(np.diff(values, n=2, axis=0), axis=1)
    noise = float(np.median(bend)) / np.sqrt(6.0) if len(bend) else 0.0
    return fastest if fastest is not None else max(at_least, _SPEED_MARGIN * _sustained(t_s, values)), (
        _NOISE_MARGIN * noise + 1e-9
    )


def _sustained(t_s: Floats, values: Floats) -> float:
    """Return the highest rate of change [per s] that lasts: over a tenth of a second, in the median of 0.4 s.

    Over a tenth of a second noise is small beside motion. A run of wrong frames, short or long, spoils at most the
    rates across its two edges: a tenth of a second each.
    """
    period = max(float(np.median(np.diff(t_s))), 1e-6)
    stride = max(1, min(len(t_s) - 1, round(0.1 / period)))
    change = np.linalg.norm(values[stride:] - values[:-stride], axis=1)
    rates = change / np.maximum(t_s[stride:] - t_s[:-stride], 1e-9)
    window = min(4 * stride + 1, len(rates))
    windows = np.lib.stride_tricks.sliding_window_view(rates, window)[:: max(1, stride // 2)]
    return float(np.max(np.median(windows, axis=1)))
