"""Tables, figures, HTML and Rerun recordings; exported here is what authors of report sections need."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agvbench.reporting.content import Bullets, Column, FigureBlock, Fold, Panel, Paragraph, Table
    from agvbench.reporting.sections.base import Section

__all__ = ["Bullets", "Column", "FigureBlock", "Fold", "Panel", "Paragraph", "Section", "Table"]

if not TYPE_CHECKING:  # mypy would take any name for an attribute of a module with __getattr__

    def __getattr__(name):
        """Import what is exported under `name`: the console needs no section, and sections take long to import."""
        from importlib import import_module

        if name not in __all__:
            raise AttributeError(f"module 'agvbench.reporting' has no attribute {name!r}")
        return getattr(import_module(f"agvbench.reporting.{'sections.base' if name == 'Section' else 'content'}"), name)
