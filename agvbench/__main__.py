"""The program ``agvbench``, also ``python -m agvbench``: Ctrl-C ends it with one line while it is imported, too."""

from __future__ import annotations

import sys
from typing import NoReturn


def entry() -> NoReturn:
    """Run the command line, and leave with its exit code."""
    try:
        from agvbench.cli import main

        code = main()
    except KeyboardInterrupt:
        sys.stderr.write("agvbench: interrupted\n")
        code = 130
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # nothing is left to interrupt but Python's own end
    sys.exit(code)


if __name__ == "__main__":
    entry()
