"""What ``agvbench effects new`` does: write the file of a new effect from its template."""

from __future__ import annotations

import keyword
import re
from pathlib import Path
from string import Template

import agvbench.effects
from agvbench.effects import effect_kinds
from agvbench.errors import FileError, FlagError

_TEMPLATE = Path(__file__).parent / "effect_template.py.txt"
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


def write_template(name: str, directory: Path | None = None) -> Path:
    """Write the file of a new effect; return its path.

    Raises
    ------
    FlagError
        If the name cannot be one, or is taken.
    FileError
        If the file exists or cannot be written.
    """
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        remedy = "use lower case words with underscores, as in servo_warm_up"
        raise FlagError("cannot be the name of an effect", where="NAME", value=repr(name), remedy=remedy)
    path = (directory or Path(agvbench.effects.__file__).parent) / f"{name}.py"
    if name in effect_kinds():
        raise FlagError("there is an effect of this name", where="NAME", value=name, remedy="choose another")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(template_text(name))
    except FileExistsError:
        raise FileError("exists already", where=path, remedy="choose another name") from None
    except OSError as error:
        raise FileError(f"cannot be written ({error.strerror})", where=path, remedy="choose another --dir") from None
    return path


def template_text(name: str) -> str:
    """Return the file of a new effect called `name`."""
    words = {"name": name, "class_name": "".join(word.capitalize() for word in name.split("_"))}
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(words)
