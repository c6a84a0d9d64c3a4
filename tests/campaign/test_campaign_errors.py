"""Every bad input of ``docs/reference/errors-campaign.md`` gives the line that the page shows.

``python tests/campaign/test_campaign_errors.py`` writes the page again from the cases.
"""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path

import bad_bags
import bad_campaigns
import bad_imports
import pytest
from campaign_samples import MAPPING, recording, write_csv

from agvbench.cli import main
from agvbench.errors import AgvbenchError

CASES = bad_campaigns.CASES | bad_imports.CASES | bad_bags.CASES
PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "errors-campaign.md"
_INTRODUCTION = """\
# Bad input: campaigns and recordings

The table lists data that agvbench cannot read, record or import, each with its error message of one line. `c` is the
directory of the campaign, `r.csv` a recording, `b` a bag and `mapping.toml` a mapping. Rows are counted from 1,
without the header. Every case is a test.

| case | input | message |
|---|---|---|
"""


def _message(case: str) -> str:
    with pytest.raises(AgvbenchError) as caught:
        CASES[case][1]()
    return str(caught.value)


def _documented() -> dict[str, str]:
    rows = [
        line.strip("|\n ").split(" | ", 2)
        for line in PAGE.read_text(encoding="utf-8").splitlines()
        if line.startswith("| `")
    ]
    return {case.strip("`"): message.strip("`").replace(r"\|", "|") for case, _, message in rows}


@pytest.mark.parametrize("case", CASES)
def test_message(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    message = _message(case)
    assert message == _documented()[case]
    assert "\n" not in message


def test_the_page_lists_each_case_and_nothing_else() -> None:
    assert list(_documented()) == list(CASES)


def test_the_command_prints_one_line_and_exits_with_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mapping.toml").write_text(MAPPING)
    write_csv(Path("r.csv"), recording() | {"X": ["?"] * 60})
    assert main(["import", "--mapping", "mapping.toml", "r.csv", "--out", "c"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err == "agvbench import: r.csv: row 1: X is not a number: '?'; correct the cell\n"
    assert not Path("c").exists()


if __name__ == "__main__":
    lines = []
    for name, (given, _) in CASES.items():
        with tempfile.TemporaryDirectory() as directory, contextlib.chdir(directory):
            shown = _message(name).replace("|", r"\|")
            lines.append(f"| `{name}` | {given} | `{shown}` |\n")
    PAGE.write_text(_INTRODUCTION + "".join(lines), encoding="utf-8")
