"""Where a campaign comes from: program, versions, revision, machine."""

from __future__ import annotations

import platform
import subprocess
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = ("agvbench", "eclipse-zenoh", "numba", "numpy", "pandas", "pyarrow", "pytest", "scipy")


def _installed(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def git_revision(directory: Path) -> str:
    """Return the git revision of `directory`, with ``+changed`` for uncommitted changes; "" outside a checkout."""
    command = ["git", "-C", str(directory), "describe", "--always", "--dirty=+changed", "--abbrev=12"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)  # noqa: S603
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def provenance(directory: Path) -> dict[str, str]:
    """Return what is worth knowing about this session, for the report and for whoever asks in a year."""
    facts = {
        "began": datetime.now(UTC).isoformat(timespec="seconds"),
        "git_revision": git_revision(directory),
        "python": sys.version.split()[0],
        "machine": platform.platform(),
        "host": platform.node(),
    }
    return facts | {package: _installed(package) for package in _PACKAGES}
