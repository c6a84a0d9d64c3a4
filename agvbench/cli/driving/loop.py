"""Close the loop: find what the model lacks, correct for it, and show every trajectory before and after.

Five stages, each with its result in the loop's directory:

  before/          a bench session that excites the vehicle: calibration, the trajectories, step responses, free driving
  diagnosis.json   what the calibrated model lacks (agvbench diagnose), and vehicle.toml, the model with the effects
  trial/           corrected plans of the trajectories, for the end-pose bias that they leave (remainders.json)
  plans.json       what plans with that model compensate, and what they cannot
  after/           the trajectories uncalibrated, calibrated and corrected, driven in turns
  report.html      before and after, trajectory by trajectory, with an equivalence test of the bias

The trajectories are those of agvbench bench: the eight and your own, or --trajectories.

The corrected model may leave a bias of the end pose, where an effect is in no library or of another form. What
is significant of this bias in before/ and in trial/ is subtracted from the goal; --no-trial uses before/ alone, and
--model-only keeps the goal.

Corrected plans change steering and durations as little as brings the model to rest on the target. Variation from run
to run cannot be corrected, nor what the diagnosis could not name. Simulated by default: a vehicle like the thesis',
which has effects that its calibration does not know.

examples:
  agvbench loop                                      the default vehicle, 10 repeats, in some minutes
  agvbench loop --repeats 30 --out loops/tonight     more repeats, into loops/tonight/
  agvbench loop --trajectories garage,figure_eight   these in place of the eight
  agvbench loop --out loops/tonight --resume         go on where it stopped
  agvbench loop --plant agvbench.simulator.hidden:lateral_slip --seed 7   a vehicle with a hidden effect
"""

from __future__ import annotations

import argparse

HELP = "bench, diagnose, correct the model, bench again: before and after"
PACKAGES = ("numba", "zenoh")
# The loop decides what is calibrated and corrected, and a calibration to the full is agvbench bench's.
_DECIDED = {"--calibration", "--corrected", "--remainders", "--full"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    from agvbench.running.configuration.session_options import OPTIONS

    for flag, keywords, text in OPTIONS:
        if flag not in _DECIDED:
            parser.add_argument(flag, help=text, **keywords)
    less = parser.add_mutually_exclusive_group()
    less.add_argument(
        "--model-only",
        action="store_true",
        help="correct with the model alone, without the measured bias of these trajectories",
    )
    less.add_argument("--no-trial", action="store_true", help="do not try corrected plans before they are compared")
    parser.add_argument("--out", metavar="DIR", help="the loop's directory (default: a new one under campaigns/)")
    parser.add_argument(
        "--resume", action="store_true", help="go on with an interrupted loop: the one in --out, or the last"
    )


def run(arguments: argparse.Namespace) -> int:
    """Go round the loop and write its report; return the exit code."""
    from agvbench.cli._option_values import check_values
    from agvbench.running.configuration.session_options import OPTIONS, destination

    check_values(vars(arguments))
    from agvbench.loop.loop import run_loop
    from agvbench.loop.settings import MODEL_ONLY, NO_TRIAL
    from agvbench.reporting.console.tables import wide_console
    from agvbench.reporting.content import plain_sentences

    console = wide_console()
    given = {
        destination(flag): None if flag in _DECIDED else getattr(arguments, destination(flag)) for flag, _, _ in OPTIONS
    }
    given["remainders"] = MODEL_ONLY if arguments.model_only else NO_TRIAL if arguments.no_trial else None
    loop = run_loop(
        given,
        out=arguments.out,
        resume=arguments.resume,
        on_progress=lambda line: console.print(plain_sentences(line), highlight=False, markup=False, soft_wrap=True),
    )
    from agvbench.reporting.loop_report import print_loop, write_loop_report

    print_loop(console, write_loop_report(loop))
    return 0
