"""The server's side of the protocol: what an emulator streams, in every version.

Sections that nothing here fills (skeletons, assets, force plates, devices) are sent empty, as Motive does.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agvbench.adapters.natnet.protocol.bitstream import Version, layout_of
from agvbench.adapters.natnet.protocol.frame import FrameOfData

_INT = struct.Struct("<i")
_PARENT = -1


@dataclass(frozen=True)
class Model:
    """A rigid body as a server describes it: markers (n, 3) [m] in the body's frame."""

    id: int
    name: str
    markers_m: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))


def encode_frame(frame: FrameOfData, version: Version, models: Sequence[Model] = ()) -> bytes:
    """Return a FRAMEOFDATA's payload.

    `models` name the marker sets; in versions before 3.0 bodies carry the labelled markers that are theirs.
    """
    layout = layout_of(version)
    labelled = np.zeros(len(frame.markers), layout.marker)
    for name in layout.marker.names or ():
        labelled[name] = frame.markers[name]
    sections = [_marker_sets(frame, models), (0, b""), _bodies(frame, version), (0, b"")]
    sections += [(0, b"")] * (version >= (4, 1)) + [(len(labelled), labelled.tobytes())] * (version >= (2, 3))
    sections += [(0, b"")] * layout.plates
    head = _INT.pack(frame.number)
    return head + b"".join(_section(*one, sized=layout.sized) for one in sections) + _tail(frame, version)


def _section(count: int, content: bytes, *, sized: bool) -> bytes:
    return _INT.pack(count) + (_INT.pack(len(content)) if sized else b"") + content


def _markers_of(frame: FrameOfData, body: int) -> NDArray[Any]:
    return frame.markers[frame.markers["id"] >> 16 == body] if len(frame.markers) else frame.markers


def _marker_sets(frame: FrameOfData, models: Sequence[Model]) -> tuple[int, bytes]:
    parts = []
    for model in models:
        markers = _markers_of(frame, model.id)
        positions = markers["position_m"].astype("<f4").tobytes() if len(markers) else b""
        parts.append(model.name.encode() + b"\0" + _INT.pack(len(markers)) + positions)
    return len(parts), b"".join(parts)


def _bodies(frame: FrameOfData, version: Version) -> tuple[int, bytes]:
    layout = layout_of(version)
    if not layout.bodies_with_markers:
        return len(frame.bodies), frame.bodies.tobytes()
    parts = []
    for body in frame.bodies:
        own = _markers_of(frame, int(body["id"]))
        parts += [_pose(body), _INT.pack(len(own))]
        if len(own):
            parts += [own["position_m"].astype("<f4").tobytes(), own["id"].astype("<i4").tobytes()]
            parts += [own["size_m"].astype("<f4").tobytes()]
        parts += [struct.pack("<f", body["mean_error_m"])]
        parts += [struct.pack("<h", body["flags"])] * layout.body_flags
    return len(frame.bodies), b"".join(parts)


def _pose(body: NDArray[Any]) -> bytes:
    return struct.pack("<i7f", body["id"], *body["position_m"], *body["quaternion"])


def _tail(frame: FrameOfData, version: Version) -> bytes:
    layout = layout_of(version)
    known = {
        "timestamp_s": frame.timestamp_s, "exposed_ticks": frame.exposed_ticks,
        "received_ticks": frame.received_ticks, "transmitted_ticks": frame.transmitted_ticks, "flags": frame.flags,
    }  # fmt: skip
    return layout.tail.pack(*(known.get(name, 0) for name in layout.tail_names)) + _INT.pack(0)


def encode_descriptions(models: Sequence[Model], version: Version) -> bytes:
    """Return a MODELDEF's payload: a marker set and a rigid body for each model."""
    parts = []
    for model in models:
        labels = [f"Marker{number}" for number in range(1, len(model.markers_m) + 1)]
        names = b"".join(label.encode() + b"\0" for label in labels)
        parts.append((0, model.name.encode() + b"\0" + _INT.pack(len(labels)) + names))
        parts.append((1, _description(model, names, version)))
    sized = version >= (4, 1)
    described = (_INT.pack(kind) + (_INT.pack(len(content)) if sized else b"") + content for kind, content in parts)
    return _INT.pack(len(parts)) + b"".join(described)


def _description(model: Model, names: bytes, version: Version) -> bytes:
    content = model.name.encode() + b"\0" + struct.pack("<ii3f", model.id, _PARENT, 0.0, 0.0, 0.0)
    if version >= (4, 2):
        content += struct.pack("<4f", 0.0, 0.0, 0.0, 1.0)
    if version >= (3, 0):
        count = len(model.markers_m)
        content += _INT.pack(count) + model.markers_m.astype("<f4").tobytes() + bytes(_INT.size * count)
        content += names if version >= (4, 0) else b""
    return content
