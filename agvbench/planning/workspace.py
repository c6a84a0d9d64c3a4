"""The floor on which the vehicle may drive: a convex region, and how far from its edge to stay."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.errors import InputError
from agvbench.types import Floats

DEFAULT_MARGIN_M = 0.25
"""Half of the vehicle's width, its overhang, and room to brake: 0.10 m from full speed (thesis 8.1)."""
STOPPING_S = 0.6
"""So long [s], at full speed, a vehicle drives on until it was seen, stopped and has come to rest: 0.1 s between two
looks, up to 0.1 s until a frame and a command have arrived, 0.3 s of braking (thesis 8.1: 0.59 s at half of the speed),
and 0.1 s for a vehicle that is faster than its nominal maps.
"""
_FORMS = "circle:DIAMETER, ellipse:WIDTHxHEIGHT, rectangle:WIDTHxHEIGHT or polygon:X,Y X,Y X,Y … (m)"
_TANGENTS = 360


@dataclass(frozen=True, eq=False)
class Workspace:
    """A convex region of the floor frame, as the half-planes that bound it: ``normals @ point <= offsets``.

    Parameters
    ----------
    name
        As the user wrote it: ``"circle:6.1"``.
    normals
        Outward unit normals, shape (k, 2).
    offsets
        Distance of each bounding line from the origin [m], shape (k,).
    margin_m
        How far the axles' centres stay away from the edge [m].
    is_round
        Whether all headings are alike in it.
    corners
        A polygon's corners, shape (k, 2).
    """

    name: str
    normals: Floats
    offsets: Floats
    margin_m: float = DEFAULT_MARGIN_M
    is_round: bool = False
    corners: Floats | None = None

    @classmethod
    def circle(cls, diameter_m: float = 6.1, margin_m: float = DEFAULT_MARGIN_M) -> Workspace:
        """Return a circle about the floor's origin; the default is the thesis' capture volume (3.1.2)."""
        return cls.ellipse(diameter_m, diameter_m, margin_m)

    @classmethod
    def ellipse(cls, width_m: float, height_m: float, margin_m: float = DEFAULT_MARGIN_M) -> Workspace:
        """Return an ellipse about the floor's origin, its axes along x and y (as a polygon of 360 tangents)."""
        _check_size(width_m, height_m, margin_m)
        angle = np.linspace(0.0, 2.0 * math.pi, _TANGENTS, endpoint=False)
        normals = np.column_stack([np.cos(angle), np.sin(angle)])
        offsets = np.hypot(0.5 * width_m * normals[:, 0], 0.5 * height_m * normals[:, 1])
        is_round = width_m == height_m
        name = f"circle:{width_m:g}" if is_round else f"ellipse:{width_m:g}x{height_m:g}"
        return cls(name, normals, offsets, margin_m, is_round)

    @classmethod
    def rectangle(cls, width_m: float, height_m: float, margin_m: float = DEFAULT_MARGIN_M) -> Workspace:
        """Return a rectangle about the floor's origin, `width_m` along x and `height_m` along y."""
        _check_size(width_m, height_m, margin_m)
        normals = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
        offsets = 0.5 * np.array([width_m, height_m, width_m, height_m])
        return cls(f"rectangle:{width_m:g}x{height_m:g}", normals, offsets, margin_m)

    @classmethod
    def polygon(cls, corners: Sequence[tuple[float, float]], margin_m: float = DEFAULT_MARGIN_M) -> Workspace:
        """Return a convex polygon with `corners` in the floor frame [m], in either sense of rotation.

        Raises
        ------
        InputError
            If there are fewer than three corners or the polygon is not convex.
        """
        points = np.array(corners, dtype=np.float64).reshape(-1, 2)
        name = "polygon:" + " ".join(f"{x:g},{y:g}" for x, y in points)
        edges = np.roll(points, -1, axis=0) - points
        following = np.roll(edges, -1, axis=0)
        bends = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
        turns = np.arctan2(bends, (edges * following).sum(axis=1)).sum() / (2.0 * math.pi)
        if len(points) < 3 or not (np.all(bends > 0.0) or np.all(bends < 0.0)) or not abs(abs(turns) - 1.0) < 1e-9:
            raise InputError(
                "polygon is not convex",
                where=name,
                limit="three corners or more",
                remedy="give its largest convex part",
            )
        outward = np.sign(bends[0]) * np.column_stack([edges[:, 1], -edges[:, 0]])
        normals = outward / np.linalg.norm(outward, axis=1, keepdims=True)
        _check_size(1.0, 1.0, margin_m)
        return cls(name, normals, (normals * points).sum(axis=1), margin_m, corners=points)

    @classmethod
    def parse(cls, text: str, margin_m: float = DEFAULT_MARGIN_M) -> Workspace:
        """Return the workspace that a user's `text` describes.

        Raises
        ------
        InputError
            If it describes none.

        Examples
        --------
        >>> Workspace.parse("rectangle:4x3").offsets.tolist()
        [2.0, 1.5, 2.0, 1.5]
        """
        form, _, rest = text.partition(":")
        try:
            if form == "circle":
                return cls.circle(float(rest), margin_m)
            if form in ("ellipse", "rectangle"):
                width, height = (float(part) for part in rest.split("x"))
                return (cls.ellipse if form == "ellipse" else cls.rectangle)(width, height, margin_m)
            if form == "polygon":
                corners = [tuple(float(part) for part in corner.split(",")) for corner in rest.split()]
                return cls.polygon([(x, y) for x, y in corners], margin_m)
        except ValueError:
            pass
        raise InputError("workspace cannot be read", value=repr(text), limit=_FORMS)

    @property
    def centre(self) -> Floats:
        """The centre of its box [m], shape (2,); the floor's origin but for a polygon."""
        if self.corners is None:
            return np.zeros(2)
        return np.asarray(0.5 * (self.corners.min(axis=0) + self.corners.max(axis=0)))

    def clearances(self, points: Floats) -> Floats:
        """Return how far each of `points` (n, 2) is inside the edge [m], shape (n,); negative outside."""
        return np.asarray((self.offsets - points @ self.normals.T).min(axis=1))


def _check_size(width_m: float, height_m: float, margin_m: float) -> None:
    for what, value, valid in (
        ("width", width_m, width_m > 0.0),
        ("height", height_m, height_m > 0.0),
        ("margin", margin_m, margin_m >= 0.0),
    ):
        if not (valid and math.isfinite(value)):
            raise InputError(f"the workspace's {what} is not a length", value=f"{value:g} m")
