"""Fuzz one target, guided by coverage: ``python -m fuzz.one TARGET [libFuzzer's options and folders]``."""

from __future__ import annotations

import sys

import atheris

from fuzz.target import targets


def main() -> None:
    """Instrument what the target decodes with, and go on until an option ends it."""
    name, *options = sys.argv[1:]
    cls = targets()[name]
    with atheris.instrument_imports(include=list(cls.instruments)):
        target = cls()
    atheris.Setup([sys.argv[0], *options], target.check)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
