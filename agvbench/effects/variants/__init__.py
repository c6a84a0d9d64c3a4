"""Other laws of causes in the library: a cause keeps its name though its law is another."""

from agvbench.effects.variants.base import Variant, cause_of, effect_variants

__all__ = ["Variant", "cause_of", "effect_variants"]
