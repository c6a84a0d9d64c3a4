"""Say whether the vehicle model is adequate, and if not which physical effect it lacks.

The runs are split into training, validation and test runs. On the training runs the static maps are fitted again,
together with one effect after another of the library. An effect is named if it improves the prediction of groups of
runs that it was not fitted to by more than chance. The residual is then compared with the repeatability.

  ADEQUATE          the residual is within repeatability
  NAMED             the effects named explain the rest
  AMBIGUOUS         several effects explain it equally well
  UNKNOWN           something is left that no effect of the library explains, and on what it depends
  NOT_IDENTIFIABLE  this campaign cannot answer the question, and why

examples:
  agvbench diagnose campaigns/tonight                         the answer and the errors before and after
  agvbench diagnose campaigns/tonight --out corrected.toml    keep the vehicle with maps refitted and effects added
  agvbench diagnose campaigns/tonight --json d.json --check   for scripts: exit code 1 unless ADEQUATE
  agvbench diagnose campaigns/tonight --report d.html         pictures of the residuals, before and after
  agvbench diagnose campaigns/tonight --next next.toml        write the run that would discriminate the alternatives
  agvbench diagnose campaigns/tonight --run-next              drive it, and decide: a copy of the campaign with the new
                                                              runs is diagnosed again, the old one is left as it is
"""

from __future__ import annotations

import argparse

from agvbench.running.configuration.option_types import whole_number

_OF_THE_RIG = (
    "--agv", "--mocap", "--camera", "--plant", "--plant-option", "--place", "--workspace", "--connect", "--bus-config",
    "--lab", "--vehicle-name",
)  # fmt: skip
HELP = "find the physical effect that the vehicle model lacks"
PACKAGES = ("numba",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    from agvbench.running.configuration.session_options import OPTIONS

    parser.add_argument("directory", metavar="DIR", help="a campaign directory")
    parser.add_argument("--json", metavar="FILE", dest="json_file", help="write the diagnosis there")
    parser.add_argument("--out", metavar="FILE", help="write the corrected vehicle there")
    parser.add_argument(
        "--vehicle", metavar="FILE", help="the model before (default: vehicle.toml in DIR, else maps fitted to DIR)"
    )
    parser.add_argument("--check", action="store_true", help="exit with 1 unless the answer is ADEQUATE")
    parser.add_argument("--seed", type=whole_number, default=0, help="draws the validation and test runs (default 0)")
    parser.add_argument(
        "--next", metavar="FILE.toml", dest="next_file", help="write the trajectory to drive next there"
    )
    parser.add_argument("--run-next", action="store_true", help="drive it on the connected plant and diagnose again")
    parser.add_argument(
        "--next-out", metavar="DIR", help="the campaign with the new runs (default: DIR-next beside DIR)"
    )
    parser.add_argument("--report", metavar="FILE.html", help="draw the residuals, before and after, into one page")
    rig = parser.add_argument_group("what --run-next drives (default: what the campaign's bench.toml says)")
    for flag, keywords, text in OPTIONS:
        if flag in _OF_THE_RIG:
            rig.add_argument(flag, help=text, **keywords)
    rig.add_argument("--plant-seed", type=whole_number, metavar="N", help="seed of a simulated plant")


def run(arguments: argparse.Namespace) -> int:
    """Diagnose; return the exit code."""
    from rich.console import Console

    from agvbench.reporting.console.diagnosis import print_diagnosis
    from agvbench.reporting.progress import searching
    from agvbench.running.configuration.session_options import destination
    from agvbench.workflows.diagnose import run_diagnose

    console = Console()

    def wrote(path: str) -> None:
        console.print(f"wrote {path}", highlight=False, markup=False, soft_wrap=True)

    found = run_diagnose(
        arguments.directory,
        show=lambda answer: print_diagnosis(answer, console),
        json_file=arguments.json_file,
        out=arguments.out,
        vehicle=arguments.vehicle,
        seed=arguments.seed,
        next_file=arguments.next_file,
        drive_next=arguments.run_next,
        next_out=arguments.next_out,
        rig={destination(flag): getattr(arguments, destination(flag)) for flag in _OF_THE_RIG}
        | {"seed": arguments.plant_seed},
        progress=searching,
        wrote=wrote,
    )
    if arguments.report is not None:
        from agvbench.reporting.write import write_diagnosis_report

        write_diagnosis_report(found, arguments.report)
        wrote(arguments.report)
    return 1 if arguments.check and not found.adequate else 0
