import pytest
import report_samples as samples

from agvbench.workflows.report import gather

QUICK = {"repeats": 3, "rate_hz": 30.0}
TWO = ("1_forward", "6_forward_right")


def _of_hostile_names(path):
    samples.make_campaign(path, **QUICK, trajectories=TWO, name=samples.HOSTILE, rename=samples.HOSTILE)
    return path


MAKERS = {
    "eight trajectories": lambda path: samples.make_campaign(path, repeats=5, rate_hz=30.0),
    "one condition": lambda path: samples.make_campaign(path, **QUICK, trajectories=TWO, conditions=("calibrated",)),
    "no calibration": lambda path: samples.make_campaign(path, **QUICK, trajectories=TWO, calibration=False),
    "own conditions": lambda path: samples.make_campaign(path, **QUICK, trajectories=TWO, conditions=("a", "b", "c")),
    "all rejected": lambda path: samples.make_campaign(
        path, repeats=1, rate_hz=30.0, trajectories=("5_forward_left",), conditions=("calibrated",)
    ),
    "free driving": samples.make_free_campaign,
    "hostile names": _of_hostile_names,
}


@pytest.fixture(scope="session")
def campaigns(tmp_path_factory):
    """Return the directory of a campaign by its kind, made when it is first asked for."""
    made = {}

    def get(kind):
        if kind not in made:
            made[kind] = MAKERS[kind](tmp_path_factory.mktemp("campaigns") / kind.replace(" ", "_"))
        return made[kind]

    return get


@pytest.fixture(scope="session")
def report_data(campaigns):
    """Return the gathered data of a campaign by its kind."""
    gathered = {}

    def get(kind):
        if kind not in gathered:
            gathered[kind] = gather(campaigns(kind))
        return gathered[kind]

    return get
