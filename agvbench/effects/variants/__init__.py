"""Variants: other equations for effects of the library, whose names they keep in a diagnosis."""

from agvbench.effects.variants.base import Variant, cause_of, causes_in, effect_variants, weights_in

__all__ = ["Variant", "cause_of", "causes_in", "effect_variants", "weights_in"]
