"""`Camera`: what a motion capture system makes of a true pose.

Five markers are seen, each with its own noise; a rigid body fitted to them gives position, heading and residual. With
noise σ per marker and axis, M markers at m_j from their centroid: position σ/√M per axis, heading σ/√Σ|m_j|².
Frames get lost, come twice, late, untracked in bursts, and now and then metres off: real recordings have all of these.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from agvbench.errors import InputError, OneOf
from agvbench.types import Floats, Frames

FIVE_MARKERS = ((0.150, 0.040), (0.110, -0.055), (0.010, 0.070), (-0.115, 0.030), (-0.155, -0.085))
"""Where the markers sit on the vehicle, forward and left of their centroid [m]: at unequal distances, so that a
tracker can distinguish them (thesis 6.1); the places themselves are free."""

_SHARES = ("lost", "untracked", "doubled", "late", "wrong")
_OPTIONS = (  # in the order of `_camera_kernel`
    *("rate_hz", "latency_s", "lost", "untracked", "burst_frames"),
    *("doubled", "late", "late_s", "wrong", "wrong_m"),
)


@dataclass(frozen=True)
class Camera:
    """A motion capture system and its faults.

    Parameters
    ----------
    rate_hz
        Frames per second.
    marker_noise_m
        Standard deviation per marker and axis, one for all or one each. Thesis 3.2.2: 0.1 to 2 mm.
    markers
        Their places on the vehicle [m], forward and left; taken relative to their centroid.
    latency_s
        From capture to arrival.
    lost, doubled, late, wrong
        Shares of frames that never arrive, arrive twice, arrive out of order, or lie metres off.
    untracked
        Share of frames with which a burst of untracked frames (NaN) begins.
    burst_frames
        Mean length of such a burst (geometric).
    late_s
        Mean extra delay of a late frame (exponential).
    wrong_m
        Size of a wrong frame's jump: uniform up to twice this, in any direction, with any heading.

    Raises
    ------
    InputError
        If a value is out of range.

    Examples
    --------
    >>> camera = Camera(rate_hz=120.0, lost=0.0, untracked=0.0, doubled=0.0, late=0.0, wrong=0.0)
    >>> frames = camera.observe(np.arange(3) / 120.0, np.zeros((3, 3)), np.random.default_rng(1))
    >>> frames.frame.tolist(), bool(np.all(np.abs(frames.x_m) < 0.002))
    ([0, 1, 2], True)
    """

    rate_hz: float = 120.0
    marker_noise_m: float | tuple[float, ...] = 0.0005
    markers: tuple[tuple[float, float], ...] = FIVE_MARKERS
    latency_s: float = 0.006
    lost: float = 0.002
    untracked: float = 0.0005
    burst_frames: float = 6.0
    doubled: float = 0.001
    late: float = 0.002
    late_s: float = 0.02
    wrong: float = 0.0002
    wrong_m: float = 1.5

    def __post_init__(self) -> None:
        """Refuse what no camera can be."""
        _in_range("rate_hz", self.rate_hz, 1.0, 10_000.0, "Hz")
        for name in _SHARES:
            _in_range(name, getattr(self, name), 0.0, 0.5, "of the frames")
        for name, unit in (("latency_s", "s"), ("late_s", "s"), ("wrong_m", "m")):
            _in_range(name, getattr(self, name), 0.0, 100.0, unit)
        _in_range("burst_frames", self.burst_frames, 1.0, 10_000.0, "frames")
        places = np.asarray(self.markers, dtype=np.float64)
        if places.ndim != 2 or places.shape[1] != 2 or len(places) < 2 or not np.isfinite(places).all():
            raise InputError(
                "camera: markers have the wrong form", value=f"shape {places.shape}", limit="at least 2 places (x, y)"
            )
        if np.ptp(places, axis=0).max() < 1e-3:
            raise InputError("camera: markers lie in one place", remedy="spread them over the vehicle")
        for noise in np.atleast_1d(self.marker_noise_m):
            _in_range("marker_noise_m", float(noise), 0.0, 0.1, "m")
        if np.size(self.marker_noise_m) not in {1, len(places)}:
            raise InputError(
                "camera: marker_noise_m does not fit the markers", value=f"{np.size(self.marker_noise_m)} values",
                limit=f"1 or {len(places)}",
            )  # fmt: skip

    @classmethod
    def perfect(cls, rate_hz: float = 120.0) -> Camera:
        """Return a camera without noise, latency or faults."""
        nothing = dict.fromkeys((*_SHARES, "marker_noise_m", "latency_s"), 0.0)
        return cls(rate_hz=rate_hz, **nothing)  # type: ignore[arg-type]

    @classmethod
    def from_options(cls, options: Mapping[str, str | float]) -> Camera:
        """Return a camera with some parameters set by name, as a command line or a file gives them.

        Raises
        ------
        InputError
            If an option is unknown, not a number or out of range.

        Examples
        --------
        >>> Camera.from_options({"lost": "0.01"}).lost
        0.01
        """
        known = [item.name for item in fields(cls) if item.name != "markers"]
        values: dict[str, float] = {}
        for name, text in options.items():
            if name not in known:
                close = difflib.get_close_matches(name, known, n=1)
                raise InputError(
                    "camera: unknown option", value=f"'{name}'", limit=OneOf(known),
                    remedy=f"did you mean '{close[0]}'?" if close else None,
                )  # fmt: skip
            try:
                values[name] = float(text)
            except (TypeError, ValueError):
                raise InputError(f"camera: {name} is not a number", value=repr(text)) from None
        return cls(**values)  # type: ignore[arg-type]

    @property
    def position_noise_m(self) -> float:
        """Standard deviation of a measured position, per axis [m]."""
        count = len(self.markers)
        return float(math.sqrt(np.sum(np.broadcast_to(self.marker_noise_m, count) ** 2)) / count)

    @property
    def heading_noise_rad(self) -> float:
        """Standard deviation of a measured heading [rad]."""
        places = _centred(self.markers)
        squares = np.sum(places**2, axis=1)
        noise = np.broadcast_to(self.marker_noise_m, len(places))
        return float(math.sqrt(np.sum(squares * noise**2)) / np.sum(squares))

    def frame_times(self, start_s: float, stop_s: float) -> Floats:
        """Return the capture times k / rate in [start, stop), k whole."""
        first, last = (math.ceil(t * self.rate_hz - 1e-6) for t in (start_s, stop_s))
        return np.arange(first, last) / self.rate_hz

    def tracker(self, rng: np.random.Generator, *, first_frame: int = 0) -> Tracker:
        """Return a tracker that watches one run; all its randomness comes from `rng`, now."""
        return Tracker(self, rng, first_frame)

    def observe(self, t_s: Floats, poses: Floats, rng: np.random.Generator, *, first_frame: int = 0) -> Frames:
        """Return the frames of a run seen at once; see `Tracker.observe`."""
        return self.tracker(rng, first_frame=first_frame).observe(t_s, poses)


class Tracker:
    """A camera while it watches one run: counts frames, and carries bursts from one batch to the next.

    However a run is cut into batches, its frames are the same bit for bit (their order of arrival is within a batch).
    """

    def __init__(self, camera: Camera, rng: np.random.Generator, first_frame: int = 0) -> None:
        from agvbench.simulator import _camera_kernel  # loads numba

        self.camera = camera
        self._kernel = _camera_kernel
        self._noise, self._luck = (np.random.default_rng(int(seed)) for seed in rng.integers(2**63, size=2))
        self._next_frame = first_frame
        self._burst_left = 0
        self._markers = _centred(camera.markers)
        self._scale = np.broadcast_to(np.reshape(camera.marker_noise_m, (-1, 1)), self._markers.shape)
        self._options = np.array([float(getattr(camera, name)) for name in _OPTIONS])

    def observe(self, t_s: Floats, poses: Floats) -> Frames:
        """Return what arrives of the frames captured at `t_s`, in order of arrival.

        Parameters
        ----------
        t_s
            Capture times [s], shape (n,).
        poses
            True poses of the marker centroid then (m, m, rad), shape (n, 3).

        Raises
        ------
        InputError
            If the shapes do not fit.
        """
        t_s = np.ascontiguousarray(t_s, dtype=np.float64)
        poses = np.ascontiguousarray(poses, dtype=np.float64)
        if t_s.ndim != 1 or poses.shape != (len(t_s), 3):
            raise InputError(
                "camera: times and poses do not fit", value=f"shapes {t_s.shape} and {poses.shape}",
                limit="(n,) and (n, 3)",
            )  # fmt: skip
        noise = self._noise.standard_normal((len(t_s), *self._scale.shape)) * self._scale
        luck = self._luck.random((len(t_s), self._kernel.LUCK))
        seen, tracked, received_s, order, self._burst_left = self._kernel.observe(
            t_s, poses, noise, luck, self._markers, self._options, self._burst_left
        )
        numbers, self._next_frame = self._next_frame + order, self._next_frame + len(t_s)
        x, y, heading, residual = seen[order].T.copy()
        return Frames(t_s[order], x, y, heading, tracked[order], numbers, residual, received_s)


def _centred(markers: tuple[tuple[float, float], ...]) -> Floats:
    """Return the markers about their centroid, shape (markers, 2)."""
    places = np.asarray(markers, dtype=np.float64)
    centred: Floats = places - places.mean(axis=0)
    return centred


def _in_range(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not low <= value <= high:
        raise InputError(f"camera: {name} is out of range", value=f"{value:g} {unit}", limit=f"{low:g} to {high:g}")
