"""A lab secured as the how-to says: its commands are run, its files are taken, addresses are those of this machine."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

HOW_TO = Path(__file__).parents[2] / "docs/how-to/secure-the-bus.md"
_ADDRESS = re.compile(r"192\.168\.0\.\d+")


def blocks(language: str) -> list[str]:
    """Return the how-to's blocks in a language."""
    text = HOW_TO.read_text(encoding="utf-8")
    return [_ADDRESS.sub("127.0.0.1", block) for block in re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)]


def set_up(folder: Path) -> dict[str, Path]:
    """Make certificates and configurations in `folder`; return the configurations by machine."""
    (commands,) = blocks("bash")
    subprocess.run(["bash", "-euc", commands], cwd=folder, check=True, capture_output=True)
    listening, connecting = blocks("json5")
    made = {"vehicle-pc": folder / "vehicle-pc.json5"}
    made["vehicle-pc"].write_text(listening)
    for name in ("bench-pc", "camera-pc", "hall-display"):
        made[name] = folder / f"{name}.json5"
        made[name].write_text(connecting.replace("bench-pc", name))
    return made
