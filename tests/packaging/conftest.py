"""Wheels, built from this checkout, in environments of their own."""

from __future__ import annotations

import os
import site
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def build_wheel(tmp_path_factory):
    """Return what builds the wheel of a folder with a pyproject.toml."""

    def build(folder):
        out = tmp_path_factory.mktemp("dist")
        command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(out)]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        return next(out.glob("*.whl"))

    return build


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Return what makes the command of an environment with a wheel and this environment's packages, not this checkout.

    Packages whose names begin with one of `without` are left out.
    """

    def install(wheel, without=()):
        root = tmp_path_factory.mktemp("environment")
        venv.create(root, with_pip=False)
        packages = next((root / "lib").glob("python3*")) / "site-packages"
        zipfile.ZipFile(wheel).extractall(packages)
        # Only third-party packages: an editable install of the checkout would hide what the wheel lacks.
        dependencies = root / "dependencies"
        dependencies.mkdir()
        left_out = ("agvbench", "_agvbench", "__editable__", "_editable", *without)
        for entry in Path(site.getsitepackages()[0]).iterdir():
            if not entry.name.startswith(left_out):
                (dependencies / entry.name).symlink_to(entry)
        # As a site directory: packages there may have files of paths themselves.
        (packages / "dependencies.pth").write_text(f"import site; site.addsitedir({str(dependencies)!r})")
        python = root / "bin" / "python"

        def run(*arguments, cwd):
            environment = {k: v for k, v in os.environ.items() if not k.startswith(("COV_", "PYTEST"))}
            command = [str(python), "-c", "import sys; from agvbench.cli import main; sys.exit(main())", *arguments]
            return subprocess.run(
                command, check=False, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300
            )

        return run

    return install
