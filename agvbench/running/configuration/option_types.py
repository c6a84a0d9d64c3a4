"""Numbers as options of a command line say them. Imports nothing heavy: ``agvbench --help`` needs it."""

from __future__ import annotations

import argparse
import re


def whole_number(text: str) -> int:
    """Return the whole number that an option says in the digits 0 to 9, without separators.

    Raises
    ------
    ArgumentTypeError
        If it says none.
    """
    if not re.fullmatch(r"[+-]?[0-9]{1,30}", text):
        raise argparse.ArgumentTypeError(f"not a whole number: {text!r}")
    return int(text)


def number(text: str) -> float:
    """Return the number that an option says, as `whole_number` with a point and an exponent, or nan or inf."""
    if not re.fullmatch(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,4})?|nan|[+-]?inf", text):
        raise argparse.ArgumentTypeError(f"not a number: {text!r}")
    return float(text)
