"""The check of terms: a rejected word is reported with its line."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SPEC = importlib.util.spec_from_file_location("check_terms", ROOT / "tools" / "check_terms.py")
GLOSSARY = """# Glossary

## Rejected words

| rejected | use instead | allowed |
|---|---|---|
| helm, at the floor | command mapping | ship's helm; agvbench/boats/ |
"""


@pytest.fixture(scope="module")
def check_terms():
    module = importlib.util.module_from_spec(SPEC)
    SPEC.loader.exec_module(module)
    return module


def project(root, file, text):
    for name, content in {"docs/reference/glossary.md": GLOSSARY, file: text}.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
    return root


@pytest.mark.parametrize(
    ("file", "text", "line"),
    [
        ("docs/page.md", "# Page\n\nThe helm turns.\n", 3),
        ("docs/page.md", "The error is at\nthe floor.\n", 1),
        ("README.md", "```\nhelm\n```\n\nThe Helm.\n", 5),
        ("agvbench/a.py", "x = 1\nmyHelm_m = x\n", 2),
        ("agvbench/a.py", '"""One.\n\nTake the helm.\n"""\n', 3),
        ("agvbench/a.py", 'x = 1\ny = f"the helm of {x}"\n', 2),
        ("agvbench/a.py", "x = 1  # the helm\n", 1),
    ],
)
def test_a_rejected_word_is_reported_with_its_line(check_terms, tmp_path, file, text, line):
    (said,) = check_terms.complaints(project(tmp_path, file, text))
    assert said.startswith(f"{file}:{line}: ")
    assert said.endswith(": use command mapping")
    assert check_terms.main([str(tmp_path)]) == 1


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("docs/page.md", "Wilhelm, `helm` and a ship's helm.\n\n~~~\nhelm\n~~~\n"),
        ("agvbench/a.py", 'overwhelm = "Wilhelm"  # `helm`\n'),
        ("agvbench/boats/a.py", "helm = 1\n"),
    ],
)
def test_other_words_code_and_what_is_allowed_are_not(check_terms, tmp_path, file, text):
    assert check_terms.main([str(project(tmp_path, file, text))]) == 0


def test_the_glossary_rejects_words(check_terms):
    # That the project uses none of them is a check of ``nox -s lint``.
    assert len(check_terms.rejected_words((ROOT / check_terms.GLOSSARY).read_text(encoding="utf-8"))) > 20
