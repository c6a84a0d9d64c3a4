"""The interface of every report section."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Self

from agvbench.reporting.content import Block, Content
from agvbench.workflows.report import ReportData


class Section(ABC):
    """One section of a report, in a file of this package or of a lab's folder ``report_sections``.

    A section turns numbers that are already there into blocks: it reads no files and computes no statistics. It never
    raises for what a campaign lacks, but says in one sentence what is absent. Names that it shows come from
    campaigns: blocks hold them as they are, renderers escape them.

    Attributes
    ----------
    slug
        Names the section in links; letters and hyphens.
    title
        Heads it.
    order
        Where it stands: sections come in ascending order.
    """

    slug: ClassVar[str]
    title: ClassVar[str]
    order: ClassVar[int]

    @abstractmethod
    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return what the section says about `data`; at least one block."""

    def checked(self) -> Self:
        """Return this section; raise `ValueError` if an attribute is missing or of another kind."""
        kinds: dict[str, type | tuple[type, ...]] = {"slug": str, "title": str, "order": (int, float)}
        for name, kind in kinds.items():
            if not isinstance(getattr(self, name, None), kind):
                raise ValueError(f"has no {name}")
        if not re.fullmatch(r"[a-z][a-z-]{0,39}", self.slug):
            raise ValueError(f"slug {self.slug!r} is not made of lower-case letters and hyphens")
        return self

    def content(self, data: ReportData) -> Content:
        """Return the section ready to be rendered."""
        return Content(self.slug, self.title, tuple(self.blocks(data)))
