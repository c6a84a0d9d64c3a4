"""Run every ``perf_*.py`` of this folder, or those named, one after another.

``python benchmarks/perf/run_all.py startup circle`` runs two of them; options after ``--`` go to each.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


def main() -> int:
    """Run them all; return 1 if one failed."""
    arguments = sys.argv[1:]
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    names, options = arguments[:cut], arguments[cut + 1 :]
    known = {path.stem.removeprefix("perf_"): path for path in sorted(HERE.glob("perf_*.py"))}
    if unknown := [name for name in names if name not in known]:
        print(f"perf: no such measurement: {', '.join(unknown)} (limit: {', '.join(known)})", file=sys.stderr)
        return 2
    failed = []
    for name in names or known:
        print(f"\n── {name} " + "─" * (76 - len(name)), flush=True)
        done = subprocess.run([sys.executable, str(known[name]), *options], check=False)  # noqa: S603
        failed += [name] if done.returncode else []
    if failed:
        print(f"perf: failed: {', '.join(failed)}", file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
