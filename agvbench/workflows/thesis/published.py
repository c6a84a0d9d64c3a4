"""A printed figure beside the one that the thesis' own tables give."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal

from agvbench.workflows.thesis.layout import Cell, Table

COLUMNS = ("figure", "where", "thesis", "ours", "agree", "remark")


@dataclass(frozen=True)
class Figure:
    """A figure as the thesis prints it (`printed`, a decimal with a point) beside ours.

    It agrees when ours, rounded to the printed decimals, is the printed one; `tolerance_units` allows for
    inputs that were themselves printed rounded, in units of the last printed decimal.
    """

    what: str
    where: str
    printed: str
    ours: float
    remark: str = ""
    tolerance_units: float = 0.5

    @property
    def agrees(self) -> bool:
        """Whether ours rounds to the printed figure.

        >>> Figure("R²", "table 7.5", "0.9991", 0.99909596).agrees
        True
        >>> Figure("slope", "eq. 7.1", "-0.0840", -0.0861).agrees
        False
        """
        printed = Decimal(self.printed)
        unit = Decimal(1).scaleb(int(printed.as_tuple().exponent))
        return abs(Decimal(repr(float(self.ours))) - printed) <= Decimal(str(self.tolerance_units)) * unit

    def row(self) -> tuple[Cell, ...]:
        """Return the cells under `COLUMNS`."""
        return (self.what, self.where, self.printed, float(self.ours), self.agrees, self.remark)


def figures_table(name: str, title: str, figures: list[Figure], note: str = "") -> Table:
    """Return a table of figures."""
    return Table(name, title, COLUMNS, tuple(figure.row() for figure in figures), note, digits=6)
