"""How figures look: colours that follow the page from light to dark, and that colour-blind readers distinguish."""

from __future__ import annotations

import io
import re
import warnings
from typing import TYPE_CHECKING, Any

from agvbench.plot.style import CONDITION_COLOURS, MARKERS, Ink, colour, marker

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "CONDITION_COLOURS",
    "GRID",
    "INK",
    "MARKERS",
    "MUTED",
    "ON_PAGE",
    "PAPER",
    "colour",
    "dress",
    "marker",
    "new_figure",
    "to_svg",
]

# Stand-ins that become CSS variables, so that one drawing serves light and dark pages.
INK, MUTED, GRID, PAPER = "#010101", "#020202", "#030303", "#040404"
ON_PAGE = Ink(INK, MUTED, GRID, PAPER)
_VARIABLES = {INK: "ink", MUTED: "muted", GRID: "grid", PAPER: "paper"} | {
    colour: f"c{index}" for index, colour in enumerate(CONDITION_COLOURS)
}
_FONT = "font-family:inherit"


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure that belongs to no global state."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained", facecolor="none")


def dress(axes: Axes, *, x: str, y: str, size: float = 10.0) -> None:
    """Give `axes` the report's look and its labels, in type of `size` points."""
    axes.set_facecolor("none")
    axes.set_xlabel(x, color=MUTED, fontsize=size)
    axes.set_ylabel(y, color=MUTED, fontsize=size)
    axes.tick_params(colors=MUTED, labelsize=size, length=2.5, width=0.6)
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    for name, spine in axes.spines.items():
        spine.set_visible(name in {"left", "bottom"})
        spine.set_color(MUTED)
        spine.set_linewidth(0.6)


def to_svg(figure: Figure, name: str) -> str:
    """Return `figure` as an SVG element for an HTML page; the same figure and name give the same text.

    Text stays text, in the page's font, and sizes follow the page.
    """
    import matplotlib as mpl

    settings: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": name, "path.simplify_threshold": 0.3}
    file = io.StringIO()
    with mpl.rc_context(settings), warnings.catch_warnings():
        # A name in a script that matplotlib's own font lacks is drawn by the browser, whose fonts are used anyway.
        warnings.filterwarnings("ignore", message=".*[Gg]lyph")
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    return _for_page(file.getvalue())


def _for_page(svg: str) -> str:
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<svg [^>]*?viewBox="([^"]*)"[^>]*>', r'<svg viewBox="\1" role="img">', svg, count=1)
    used = set(re.findall(r'(?:href="|url\()#([^")]*)', svg))
    svg = re.sub(r' id="([^"]*)"', lambda found: found[0] if found[1] in used else "", svg)
    svg = re.sub(r"font: ([\d.]+)px [^;\"]*", rf"font-size:\1px;{_FONT}", svg)
    for stand_in, variable in _VARIABLES.items():
        svg = svg.replace(stand_in, f"var(--{variable})")
    return re.sub(r"\n\s*", "\n", svg)
