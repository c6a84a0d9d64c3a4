"""The poses that the camera reports: at the start of a run, at rest, and within each step.

Frames are evaluated from the polynomial of a step. A part of the kernel; see `agvbench.model.simulation.compose`.
"""

from __future__ import annotations

from agvbench.effects.state import HEADING, SEEN_HEADING, SEEN_LAG, SEEN_X, SEEN_Y, X, Y
from agvbench.model.compiled import compiled
from agvbench.model.simulation.layout import ALONG_X, ALONG_Y, BASIS, COUNT, SMOOTH, TO_NODES, TURNED
from agvbench.model.simulation.smoothing import bend, smoothed
from agvbench.model.simulation.stages import capture, see
from agvbench.types import Floats


@compiled(inner=True)
def start_run(s: Floats, p: Floats, initial: Floats, run: int) -> None:
    """Put the true pose into `s` that the camera reports as `initial`, by fixed-point iteration."""
    s[X], s[Y], s[HEADING] = initial[run, 0], initial[run, 1], initial[run, 2]
    for _ in range(60):
        look(s, p)
        x, y, heading = initial[run, 0] - s[SEEN_X], initial[run, 1] - s[SEEN_Y], initial[run, 2] - s[SEEN_HEADING]
        s[X] += x
        s[Y] += y
        s[HEADING] += heading
        if abs(x) + abs(y) + abs(heading) < 1e-14:
            break


@compiled(inner=True)
def look(s: Floats, p: Floats) -> None:
    """Put into `s` the pose that a camera without smoothing reports."""
    s[SEEN_X], s[SEEN_Y], s[SEEN_HEADING] = s[X], s[Y], s[HEADING]
    see(s, p)


@compiled(inner=True)
def report(s: Floats, p: Floats, out: Floats, k: int) -> None:
    """Report the pose in `s` as frame `k`."""
    look(s, p)
    out[k, 0], out[k, 1], out[k, 2] = s[SEEN_X], s[SEEN_Y], s[SEEN_HEADING]


@compiled(inner=True)
def wait(s: Floats, p: Floats, start: Floats, until: float, t_s: Floats, out: Floats, k: int, stop: int) -> int:
    """Report the pose at the start for every frame captured up to `until`; return the next one."""
    while k < stop and capture(s, t_s[k], p) <= until:
        s[X], s[Y], s[HEADING] = start[0], start[1], start[2]
        report(s, p, out, k)
        k += 1
    return k


@compiled(inner=True)
def see_step(s: Floats, p: Floats, work: Floats, start: Floats, length: float) -> None:
    """Store the true poses of a step for a smoothing camera."""
    for i in range(COUNT + 1):
        x, y, heading = start[0], start[1], start[2]
        if i > 0:
            for j in range(COUNT):
                x += length * TO_NODES[i - 1, j] * work[ALONG_X + j]
                y += length * TO_NODES[i - 1, j] * work[ALONG_Y + j]
                heading += length * TO_NODES[i - 1, j] * work[TURNED + j]
        s[X], s[Y], s[HEADING] = x, y, heading
        look(s, p)
        for channel in range(3):
            work[SMOOTH + channel * (COUNT + 1) + i] = s[SEEN_X + channel]
    bend(work, SMOOTH)


@compiled(inner=True)
def follow_seen(s: Floats, work: Floats, start: Floats, length: float, share: float, out: Floats) -> None:
    """Report the pose of a smoothing camera after a share of a step."""
    for i in range(3):
        out[i] = smoothed(work, SMOOTH + i * (COUNT + 1), start[4 + i], length / s[SEEN_LAG], share)


@compiled(inner=True, fast=True)
def report_step(
    s: Floats, p: Floats, work: Floats, start: Floats, now: float, length: float, t_s: Floats, out: Floats, k: int,
    stop: int,
) -> int:  # fmt: skip
    """Report the frames captured in a step from `now`; return the next one."""
    when = capture(s, t_s[k], p)
    while when <= now + length:
        elapsed = when - now
        share = elapsed / length
        x = y = heading = 0.0
        for j in range(COUNT):
            weight = elapsed * (BASIS[j, 0] + share * (BASIS[j, 1] + share * (BASIS[j, 2] + share * BASIS[j, 3])))
            x += weight * work[ALONG_X + j]
            y += weight * work[ALONG_Y + j]
            heading += weight * work[TURNED + j]
        s[X], s[Y], s[HEADING] = start[0] + x, start[1] + y, start[2] + heading
        if s[SEEN_LAG] > 0.0:
            follow_seen(s, work, start, length, share, out[k])
        else:
            report(s, p, out, k)
        k += 1
        if k == stop:
            break
        when = capture(s, t_s[k], p)
    return k
