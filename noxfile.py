"""What people run: ``nox -s bench`` is the main job, ``nox -s tests`` passes the tests.

Arguments after ``--`` go to the tool of the session: ``nox -s bench -- --repeats 3 --out campaigns/tonight``.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import nox

nox.needs_version = ">=2024.10"
nox.options.default_venv_backend = "uv|virtualenv"
nox.options.reuse_existing_virtualenvs = True
nox.options.sessions = ["lint", "tests", "docs"]

LOCK = "requirements.lock"
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
SIDE_BY_SIDE = ("-n", "2", "--dist", "worksteal")
FIRMWARE_PACKAGES = ["make", "gcc", "libc6-dev", "gcc-avr", "avr-libc", "simavr", "libsimavr-dev"]


def install(session: nox.Session, *extras: str) -> None:
    """Install agvbench for editing, with exactly the versions of the lock file."""
    wanted = f".[{','.join(extras)}]" if extras else "."
    if "test" in extras:
        # Tests start hundreds of processes: one that finds no byte code compiles for seconds what it imports.
        session.env.update({"UV_COMPILE_BYTECODE": "1", "PYTHONDONTWRITEBYTECODE": ""})
    session.install("--quiet", "-c", LOCK, "-e", wanted)


@nox.session
def bench(session: nox.Session) -> None:
    """Calibrate, drive the eight trajectories under each condition, write campaign and report."""
    install(session)
    session.run("agvbench", "bench", *session.posargs)


@nox.session
def nightly(session: nox.Session) -> None:
    """Drive a night, diagnose it, compare it with the last good one: ``agvbench nightly``."""
    install(session)
    session.run("agvbench", "nightly", "--seed", "1", *session.posargs)


@nox.session
def tests(session: nox.Session) -> None:
    """Run the tests that take seconds; those of the wall clock are repeated once where they fail, and listed."""
    install(session, "test")
    session.run("pytest", *(session.posargs or ("-m", "not slow", *SIDE_BY_SIDE)))


@nox.session
def tests_slow(session: nox.Session) -> None:
    """Run the tests that take more than ten seconds each: diagnoses of whole campaigns, blind trials, simulations."""
    install(session, "test")
    session.run("pytest", *(session.posargs or ("-m", "slow", *SIDE_BY_SIDE)))


@nox.session(python=PYTHONS)
def tests_all(session: nox.Session) -> None:
    """Run all tests, slow ones included, on each supported Python, one after another."""
    install(session, "test")
    session.run("pytest", *(session.posargs or SIDE_BY_SIDE))


@nox.session(python=PYTHONS[0], venv_backend="uv")
def lowest(session: nox.Session) -> None:
    """Run all tests with the oldest dependencies that pyproject.toml allows, on the oldest Python."""
    session.install("--quiet", "--resolution", "lowest-direct", "-e", ".[test]")
    session.run("pytest", *(session.posargs or SIDE_BY_SIDE))


@nox.session
def coverage(session: nox.Session) -> None:
    """Run all tests and list the lines that none reaches, in nearly twice the time; too many are an error."""
    install(session, "test")
    arguments = session.posargs or ("--cov-fail-under=90", *SIDE_BY_SIDE)
    session.run("pytest", "--cov", "--cov-report=term:skip-covered", *arguments)


@nox.session(venv_backend="none")
def firmware(session: nox.Session) -> None:
    """Build the vehicle's firmware and the simulated microcontroller; install the tools first where that is allowed."""
    if shutil.which("avr-gcc") is None or not Path("/usr/include/simavr/sim_avr.h").exists():
        install_packages(session, FIRMWARE_PACKAGES)
    session.run("make", "-C", "firmware", *session.posargs, external=True)


@nox.session(venv_backend="none")
def browser(session: nox.Session) -> None:
    """Install Chromium for the tests of pages, where there is none and that is allowed."""
    if not any(map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))):
        install_packages(session, ["chromium"])


def install_packages(session: nox.Session, packages: list[str]) -> None:
    """Install packages of Debian as root, or say what an administrator has to do."""
    command = ["apt-get", "install", "--yes", "--quiet", "--no-install-recommends", *packages]
    if shutil.which("apt-get") is None or os.geteuid() != 0:
        session.error("tools are missing; as an administrator: " + " ".join(command))
    session.run("apt-get", "update", "--quiet", external=True)
    session.run(*command, external=True)


@nox.session
def lint(session: nox.Session) -> None:
    """Check style, types, layers and terms."""
    install(session, "lint", "test")
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("mypy")
    session.run("lint-imports")
    session.run("python", "tools/check_terms.py")


@nox.session
def docs(session: nox.Session) -> None:
    """Run every example in docstrings and documents, build the site into site/, and open its pages in a browser."""
    install(session, "test", "docs")
    session.run("pytest", "--doctest-modules", "--doctest-glob=*.md", "agvbench", "docs", "README.md", "-q")
    session.run("zensical", "build", "--strict", "--clean")
    session.run("pytest", "tests/pages/test_site.py", "-q")


@nox.session
def documents(session: nox.Session) -> None:
    """Run every shell block of README, tutorial and how-tos as it stands; AGVBENCH_SEED=N sets the seed."""
    install(session, "test")
    session.run("pytest", "tests/documents", "-q", *session.posargs, env={"AGVBENCH_DOCUMENTS": "full"})


@nox.session
def perf(session: nox.Session) -> None:
    """Measure speed and accuracy against peers, in one run, and print the ratios."""
    install(session, "test")
    session.run("python", "benchmarks/perf/run_all.py", *session.posargs)


@nox.session
def fuzz(session: nox.Session) -> None:
    """Feed every decoder malformed inputs, for half an hour of processor time."""
    install(session, "fuzz")
    session.run("python", "-m", "fuzz", *session.posargs)


@nox.session
def explore(session: nox.Session) -> None:
    """Test every property on fresh random examples, 25 rounds (AGVBENCH_EXPLORE=N for N); prints each failing example.

    A failing example is pinned with ``@example`` on its test when the cause is fixed.
    """
    install(session, "test")
    rounds = os.environ.get("AGVBENCH_EXPLORE", "25")
    where = session.posargs or ("tests",)
    session.run("pytest", "-m", "hypothesis", *SIDE_BY_SIDE, *where, env={"AGVBENCH_EXPLORE": rounds})


@nox.session
def challenge(session: nox.Session) -> None:
    """Hold blind trials of the diagnosis; again goes on where it was interrupted."""
    install(session)
    trials = ["--seeds", "10", "--first-seed", "1000", "--json", "campaigns/challenge.json", "--resume"]
    session.run("agvbench", "challenge", *(session.posargs or trials))


@nox.session
def loop(session: nox.Session) -> None:
    """Bench, diagnose, correct the model, bench again: every trajectory before and after."""
    install(session)
    session.run("agvbench", "loop", *session.posargs)


@nox.session(venv_backend="none")
def lock(session: nox.Session) -> None:
    """Resolve the newest versions that pyproject.toml allows into the lock file."""
    session.run(
        "uv", "pip", "compile", "--quiet", "--universal", "--all-extras", "--upgrade", "--no-emit-index-url",
        "--python-version", "3.11", "pyproject.toml", "-o", LOCK, external=True,
    )  # fmt: skip
