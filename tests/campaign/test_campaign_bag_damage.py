"""Damaged and hostile bags: refused in one line, without code from the file and without memory that it demands."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import warnings
from pathlib import Path
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ros_bags import DIFFERENTIAL, KINDS, Sent, driven, write_bag
from rosbags.interfaces import Connection, MessageDefinition, MessageDefinitionFormat

from agvbench.campaign import import_recordings
from agvbench.campaign.recordings.bags import bag as bag_module
from agvbench.campaign.recordings.bags.definitions import typestore_for
from agvbench.cli import main
from agvbench.errors import AgvbenchError, FileError


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> dict[str, tuple[Path, bytes]]:
    """Return by kind the file of a bag, and its content."""
    found = {}
    for kind in KINDS:
        folder = tmp_path_factory.mktemp("whole")
        bag = write_bag(folder, "b", kind, driven(9))
        file = next(f for f in bag.iterdir() if f.suffix != ".yaml") if bag.is_dir() else bag
        found[kind] = (file, file.read_bytes())
    return found


@settings(max_examples=150)
@given(
    kind=st.sampled_from(KINDS),
    length=st.floats(0.0, 1.0),
    flips=st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(1, 255)), max_size=4),
)
def test_a_damaged_bag_is_imported_or_refused_in_one_line(kind, length, flips, whole, tmp_path_factory):
    file, data = whole[kind]
    damaged = bytearray(data[: int(len(data) * length)] if not flips else data)
    for where, change in flips:
        damaged[int(where * len(damaged))] ^= change
    folder = tmp_path_factory.mktemp("damaged")
    (folder / "mapping.toml").write_text(DIFFERENTIAL)
    file.write_bytes(damaged)
    bag = file.parent if (file.parent / "metadata.yaml").exists() else file
    refused = ""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            import_recordings(folder / "mapping.toml", [bag], folder / "c")
        except AgvbenchError as error:
            refused = str(error)
    file.write_bytes(data)
    assert "\n" not in refused
    assert bool(refused) is not (folder / "c").exists()


def test_a_bag_that_decompresses_into_more_than_the_limit_is_refused(tmp_path):
    log = Sent(driven()[-1].ns, "/log", lambda make: make("std_msgs/String", "0" * (128 << 20)))
    bag = write_bag(tmp_path, "b", "mcap zstd", [*driven(), log])
    assert (bag / "b.mcap").stat().st_size < 1 << 20
    (tmp_path / "mapping.toml").write_text(DIFFERENTIAL)
    before = resource.getrlimit(resource.RLIMIT_DATA), resource.getrlimit(resource.RLIMIT_FSIZE)
    with (
        mock.patch.object(bag_module, "MAX_BYTES", 32 << 20),
        pytest.raises(FileError, match=r"b: takes too much memory to read|Allocation error|allocate"),
    ):
        import_recordings(tmp_path / "mapping.toml", [bag], tmp_path / "c")
    assert (resource.getrlimit(resource.RLIMIT_DATA), resource.getrlimit(resource.RLIMIT_FSIZE)) == before
    assert len(import_recordings(tmp_path / "mapping.toml", [bag], tmp_path / "c")) == 1


def connection(definition: str, kind: str = "my_msgs/msg/Own") -> Connection:
    text = MessageDefinition(MessageDefinitionFormat.MSG, definition)
    return Connection(1, "/own", kind, text, "", 1, None, None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ("my_msgs/Own again\n", "contains itself"),
        ("float64[1000000000] numbers\n", "too large"),
        ("my_msgs/Missing part\n", "has no definition of a type: my_msgs/msg/Missing"),
        ("my_msgs/A[1000] a\n" + "=" * 80 + "\nMSG: my_msgs/A\nfloat64[1000] b\n", "too large"),
    ],
)
def test_a_definition_that_would_make_too_much_code_is_refused(definition, message):
    with pytest.raises(FileError, match=message):
        typestore_for([connection(definition)], Path("b"), is_ros1=False)


def test_no_constant_of_a_definition_becomes_code():
    """rosbags compiles what it makes of definitions: constants, which may be any text, are left out."""
    definition = 'string TEXT="\\n__import__(1)"\nfloat64 value\n'
    store = typestore_for([connection(definition)], Path("b"), is_ros1=False)
    assert store.fielddefs["my_msgs/msg/Own"] == ([], [("value", (1, ("float64", 0)))])
    assert not hasattr(store.types["my_msgs/msg/Own"], "TEXT")


@pytest.mark.parametrize("name", ["my_msgs/msg/Own:\n    import os", "my_msgs/msg/Own'", "Own", "my_msgs/msg/1"])
def test_a_type_with_another_name_than_an_identifier_is_refused(name):
    types = {name: ([], [("value", (1, ("float64", 0)))])}
    with (
        mock.patch("agvbench.campaign.recordings.bags.definitions.get_types_from_msg", return_value=types),
        pytest.raises(FileError, match="names that are none"),
    ):
        typestore_for([connection("", name)], Path("b"), is_ros1=False)


def test_without_rosbags_the_command_says_what_to_install(tmp_path):
    (tmp_path / "mapping.toml").write_text(DIFFERENTIAL)
    bag = write_bag(tmp_path, "b", "mcap", driven())
    program = "import sys; sys.modules['rosbags'] = None; from agvbench.cli import main; sys.exit(main(sys.argv[1:]))"
    for arguments in (["--mapping", "mapping.toml"], ["--guess"]):
        command = [sys.executable, "-c", program, "import", *arguments, bag.name, "--out", "c"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert (
            done.stderr
            == "agvbench import: b: is a ROS bag, for which rosbags is not installed; pip install 'agvbench[ros]'\n"
        )


def test_reading_a_csv_and_asking_for_help_do_not_load_rosbags(tmp_path, capsys):
    program = (
        "import sys, agvbench, agvbench.campaign.recordings.importer, agvbench.workflows.exchange.import_recordings\n"
        "import agvbench.workflows.exchange.export_mcap\n"
        "print(any(name.startswith('rosbags') for name in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_a_pipe_is_not_waited_for(tmp_path, capsys):
    os.mkfifo(tmp_path / "b.bag")
    (tmp_path / "mapping.toml").write_text(DIFFERENTIAL)
    arguments = [
        "import",
        "--mapping",
        str(tmp_path / "mapping.toml"),
        str(tmp_path / "b.bag"),
        "--out",
        str(tmp_path / "c"),
    ]
    assert main(arguments) == 2
    assert "is a pipe or a device" in capsys.readouterr().err
