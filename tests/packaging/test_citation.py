import re
import tomllib
from pathlib import Path

import agvbench

ROOT = Path(__file__).parents[2]


def test_the_citation_and_the_change_log_name_this_version():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    version, date = (re.search(rf"^{key}: (.+)$", citation, re.M)[1] for key in ("version", "date-released"))
    assert version == agvbench.__version__
    assert f"## {version} – {date}\n" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_citation_has_the_repository_of_the_package():
    urls = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]
    assert f"repository-code: {urls['Source']}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
