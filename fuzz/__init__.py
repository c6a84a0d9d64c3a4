"""Malformed inputs, by the million: what every decoder makes of them.

``nox -s fuzz`` feeds each of `fuzz.targets` for its share of half an hour of processor time, guided by coverage; the
tests replay ``fuzz/corpus`` (what was found worth keeping, and whatever once did harm) and draw some more.
"""
