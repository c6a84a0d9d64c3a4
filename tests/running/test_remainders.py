import pytest

from agvbench.errors import FileError
from agvbench.running.session.end_pose_bias import read_bias_corrections
from agvbench.types import Pose


def test_what_a_loop_writes_is_read(tmp_path):
    path = tmp_path / "remainders.json"
    path.write_text('{"schema": 1, "remainders": {"5": {"x_m": 0.004, "y_m": -1e-3, "heading_rad": 0, "runs": 3}}}')
    assert read_bias_corrections(str(path)) == {"5": Pose(0.004, -0.001, 0.0)}
    assert not read_bias_corrections("")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("no json", "not a file of remainders"),
        ("[1, 2]", "not a file of remainders"),
        ('{"remainders": {"1": {"x_m": 0.1}}}', "not a file of remainders: 'y_m'"),
        ('{"remainders": {"1": {"x_m": NaN, "y_m": 0, "heading_rad": 0}}}', "1: is not finite"),
    ],
)
def test_anything_else_is_refused(tmp_path, text, line):
    path = tmp_path / "remainders.json"
    path.write_text(text)
    with pytest.raises(FileError, match=line):
        read_bias_corrections(str(path))
    path.unlink()
    with pytest.raises(FileError, match="cannot be read"):
        read_bias_corrections(str(path))
