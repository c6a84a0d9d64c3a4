"""How figures look: colours that follow the page from light to dark, and that colour-blind readers distinguish."""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from agvbench.plot.style import CONDITION_COLOURS, Ink
from agvbench.reporting.content import plain
from agvbench.types import Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Stand-ins that become CSS variables, so that one drawing serves light and dark pages.
INK, MUTED, GRID, PAPER = "#010101", "#020202", "#030303", "#040404"
ON_PAGE = Ink(INK, MUTED, GRID, PAPER)
_VARIABLES = {INK: "ink", MUTED: "muted", GRID: "grid", PAPER: "paper"} | {
    colour: f"c{index}" for index, colour in enumerate(CONDITION_COLOURS)
}
_FONT = "font-family:inherit"


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure that belongs to no global state, and whose margins fit what is drawn."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained", facecolor="none")


def new_panel(width_in: float, height_in: float) -> Figure:
    """Return an empty figure with room for two labels and ticks of six characters: fitting many takes twice the time.

    Nothing is left outside the axes at the top and at the right but half a tick's label.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), facecolor="none")
    left, bottom, right, top = 0.75, 0.52, width_in - 0.15, height_in - 0.08
    figure.subplots_adjust(left / width_in, bottom / height_in, right / width_in, top / height_in)
    return figure


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


def legend(numbers: Mapping[str, int]) -> list[tuple[str, int]]:
    """Return what a figure's legend names; nothing where runs have no conditions.

    >>> legend({"calibrated": 1, "": 3}), legend({"": 3})
    ([('calibrated', 1), ('no condition', 3)], [])
    """
    return [(plain(name) or "no condition", number) for name, number in numbers.items()] if any(numbers) else []


def panel_title(name: str, target: Pose) -> str:
    """Return the trajectory's name and where it leads, in the start frame.

    >>> panel_title("6", Pose(1.0, -1.0, -math.pi / 2))
    '6: to (1, −1) m, −90°'
    >>> panel_title("8", Pose(-3.3e-16, 3.7e-32, 0.0))
    '8: to (0, 0) m, 0°'
    """
    if not name:
        return ""
    numbers = (target.x_m, target.y_m, math.degrees(target.heading_rad))
    x, y, heading = (f"{round(value, 6) + 0.0:.3g}".replace("-", "−") for value in numbers)
    return plain(f"{name}: to ({x}, {y}) m, {heading}°")


def to_svg(figure: Figure, name: str) -> str:
    """Return `figure` as an SVG element for an HTML page; the same figure and name give the same text.

    Text stays text, in the page's font, and sizes follow the page.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    settings: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": name, "path.simplify_threshold": 0.3}
    file = io.StringIO()
    with mpl.rc_context(settings), warnings.catch_warnings():
        # A name in a script that matplotlib's own font lacks is drawn by the browser, whose fonts are used anyway.
        warnings.filterwarnings("ignore", message=".*[Gg]lyph")
        # `savefig` would draw it twice, the first time for the layout alone, which a drawing makes anyway.
        metadata = {"Date": None, "Creator": None, "Format": None, "Type": None}
        FigureCanvasSVG(figure).print_svg(file, metadata=metadata)  # type: ignore[no-untyped-call]
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
