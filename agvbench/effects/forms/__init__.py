"""Other laws of causes in the library: a cause keeps its name though its law is another."""

from agvbench.effects.forms.base import Form, cause_of, effect_forms

__all__ = ["Form", "cause_of", "effect_forms"]
