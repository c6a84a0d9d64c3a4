"""What it takes to tell effects apart that no drive from rest to rest tells apart."""

from __future__ import annotations

from itertools import combinations

_NEEDS: dict[frozenset[str], str] = {
    frozenset({"actuation_delay", "mocap_latency"}): (
        "a time that vehicle and cameras share: a light on the vehicle that its firmware switches with the drive, "
        "an encoder on board that is logged with the commands, or the vehicle pushed by hand with a clap in view"
    ),
    frozenset({"wheel_diameter_mismatch", "marker_offset"}): (
        "the vehicle turned on a jig about a known point, or tight circles both ways, which need a floor that is "
        "large enough"
    ),
    frozenset({"mocap_scale", "axle_speed_mismatch"}): "two markers at a known distance, or a tape along a straight",
}
_CLOCK = "a reference beside cameras and commands, such as an encoder on board"
_LENGTH = "two markers at a known distance, measured at several places"
_AXES = "the vehicle's own axis measured on the floor, with a straight edge or by pushing it along a rail"
_BY_STAGE = {
    "mocap_latency": _CLOCK,
    "actuation_delay": _CLOCK,
    "mocap_scale": _LENGTH,
    "heading_misalignment": _AXES,
    "marker_offset": "the markers' centroid measured against the axles, or the vehicle turned on a jig",
}


def what_it_takes(names: tuple[str, ...]) -> str:
    """Return what would tell the effects called `names` apart, in words.

    >>> what_it_takes(("mocap_latency", "actuation_delay")).partition(":")[0]
    'a time that vehicle and cameras share'
    """
    for pair in combinations(names, 2):
        if frozenset(pair) in _NEEDS:
            return _NEEDS[frozenset(pair)]
    for name in names:
        if name in _BY_STAGE:
            return _BY_STAGE[name]
    return (
        "a direct measurement of one of them: an angle, a speed or a distance that does not come from the same drives"
    )
