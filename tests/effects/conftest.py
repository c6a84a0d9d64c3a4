"""The effects of a folder of the user, in a process that has loaded the library's."""

from __future__ import annotations

import sys

import pytest

from agvbench.effects import registry
from agvbench.effects.registry import OWN_EFFECTS, effect_kinds


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Return a function: the effects that `effect_kinds` finds in ``tmp_path/effects``, beside those of a library."""
    monkeypatch.chdir(tmp_path)

    def kinds(library=()):
        monkeypatch.setattr(registry, "classes_in_folders", lambda *_: list(library))
        return effect_kinds.__wrapped__()

    yield kinds
    for name in [name for name in sys.modules if name.partition(".")[0] == OWN_EFFECTS.imported_as]:
        del sys.modules[name]
