"""``agvbench export --format mcap``: each run as a bag of ROS 2 with MCAP storage, which Foxglove opens, too."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from agvbench.campaign import Campaign, CampaignHeader
from agvbench.campaign.arguments import as_campaign
from agvbench.campaign.atomic_files import made_folder, write_atomically
from agvbench.campaign.tables.parts import part_name
from agvbench.errors import FileError, FitError
from agvbench.metrics.planned_paths import PlannedPaths
from agvbench.statistics.rest_poses import start_pose
from agvbench.types import Command, Commands, Floats, Pose, Run
from agvbench.vehicle.channel_tables import channel_names
from agvbench.vehicle.wheels import WheelCommand
from agvbench.workflows.exchange.export_tum import Exported
from agvbench.workflows.history.folders import dated

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

MAPPING_FILE = "import.toml"
POSE, PLAN, TARGET, TWIST, COMMAND = "/pose", "/plan", "/target", "/cmd_vel", "/command/"
FRAME = "floor"
_METADATA_VERSION: Final = 8  # 9, of newer ROS 2, states quality of service in another form
_LONGEST_S = 1e9


class _Entry(NamedTuple):
    """A message of a bag: its time, topic and content."""

    ns: int
    topic: str
    message: Any


def export_mcap(
    campaign: Campaign | str | Path, out: str | Path, *, track: Callable[[Sequence[Run]], Iterable[Run]] = iter
) -> Exported:
    """Write a bag ``RUN/`` of every run that counts into `out`, and `MAPPING_FILE`, with which they are imported again.

    Topics: `POSE` (PoseStamped, the tracked frames in the floor frame, at their capture times); the commands, `TWIST`
    (TwistStamped) of a differential vehicle that is commanded in SI units, else a Float64 for each channel under
    `COMMAND`; `PLAN` (Path) and `TARGET` (PoseStamped) in the floor frame, where they are known. Times are those of the
    campaign, since 1970. Until the first command the vehicle stands at neutral; the bag says so by a neutral command
    with the first frame.

    Parameters
    ----------
    campaign
        A campaign, or its directory.
    out
        The directory; it is made if it is not there.
    track
        Wraps the runs while they are written, to show progress.

    Returns
    -------
    The bags and the mapping; ``left_out`` are the runs whose plan and target are not in the floor frame, because they
    were not seen at rest before they began.

    Raises
    ------
    InputError
        If `campaign` is neither.
    CampaignError
        If the campaign cannot be read.
    FileError
        If rosbags is not installed, a bag exists already, or `out` cannot be written.
    """
    opened, out = as_campaign(campaign), Path(out)
    _require_rosbags()
    messages, paths = _Messages(opened), PlannedPaths(opened)
    runs = [run for run in opened if run.is_ok]
    left_out, files = list[str](), list[Path]()
    for path in (_bag_path(out, run) for run in runs):
        if path.exists():
            raise FileError("exists already", where=path, remedy="choose another --out")
    try:
        with made_folder(out):
            for run in track(runs):
                entries = [*messages.poses(run), *messages.commands(run)]
                try:
                    entries += messages.plan(run, paths.of(run) if run.target.is_finite else None)
                except FitError:
                    left_out.append(run.run_id)
                files.append(_write(_bag_path(out, run), sorted(entries, key=lambda entry: entry.ns), messages.store))
            files.append(_write_mapping(out / MAPPING_FILE, opened.header, runs, messages))
    except OSError as error:
        raise FileError("cannot be written", where=out, value=error.strerror, remedy="choose another --out") from None
    return Exported(files, left_out)


def _bag_path(out: Path, run: Run) -> Path:
    return out / part_name(run.run_id).removesuffix(".parquet")


def _require_rosbags() -> None:
    try:
        import rosbags  # noqa: F401
    except ImportError:
        remedy = "pip install 'agvbench[ros]'"
        raise FileError("needs rosbags, which is not installed", where="--format mcap", remedy=remedy) from None


class _Messages:
    """Makes the messages of runs; all times are on the clock of the campaign, since 1970."""

    def __init__(self, campaign: Campaign) -> None:
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS2_HUMBLE)
        self._header = campaign.header
        self._began_ns = int(dated(campaign.path).at.timestamp()) * 1_000_000_000
        channels, kinematics = campaign.header.channels, campaign.header.kinematics
        is_si = all(getattr(channels, role).unit == "si" for role in channel_names(kinematics))
        self._wheels = channels.wheels
        self.is_twist = kinematics == "differential" and is_si and self._wheels is None

    def poses(self, run: Run) -> Iterator[_Entry]:
        """Yield the tracked poses."""
        frames = run.frames
        rows = np.column_stack([frames.t_s, frames.x_m, frames.y_m, frames.heading_rad])
        for t_s, *pose in rows[frames.tracked & np.isfinite(rows).all(axis=1)].tolist():
            ns = self._ns(run, t_s)
            yield _Entry(ns, POSE, self._pose(ns, Pose(*pose)))

    def commands(self, run: Run) -> Iterator[_Entry]:
        """Yield the commands, and before them that of a vehicle that stands."""
        commands, seen_s = run.commands, run.frames.t_s[run.frames.tracked]
        neutral = self._header.neutral if self._wheels is None else self._wheels.neutral
        if len(seen_s) and len(commands) and seen_s.min() < commands.t_s[0]:
            yield from self._command(self._ns(run, float(seen_s.min())), neutral._asdict())
        values = self._of_channels(commands)
        for index, t_s in enumerate(commands.t_s.tolist()):
            yield from self._command(self._ns(run, t_s), {name: float(of[index]) for name, of in values.items()})

    def _of_channels(self, commands: Commands) -> dict[str, Floats]:
        """Return the commands (n,) of each channel, by role or wheel."""
        if self._wheels is None:
            return {role: getattr(commands, role) for role in Command._fields}
        return dict(zip(WheelCommand._fields, self._wheels.wheels(commands.drive, commands.front), strict=True))

    def _command(self, ns: int, command: dict[str, float]) -> Iterator[_Entry]:
        for topic, column, channel in self.command_fields():
            if self.is_twist and column.endswith("linear.x"):
                linear, angular = (
                    self._new("geometry_msgs/msg/Vector3", *numbers)
                    for numbers in ((command["drive"], 0.0, 0.0), (0.0, 0.0, command["front"]))
                )
                twist = self._new("geometry_msgs/msg/Twist", linear, angular)
                yield _Entry(ns, topic, self._new("geometry_msgs/msg/TwistStamped", self._stamped(ns), twist))
            elif not self.is_twist:
                yield _Entry(ns, topic, self._new("std_msgs/msg/Float64", command[channel]))

    def command_fields(self) -> list[tuple[str, str, str]]:
        """Return topic and field of each command channel, and its role or wheel."""
        if self.is_twist:
            return [(TWIST, "twist.linear.x", "drive"), (TWIST, "twist.angular.z", "front")]
        if self._wheels is not None:
            return [(f"{COMMAND}{wheel}", "data", wheel) for wheel in WheelCommand._fields]
        names = channel_names(self._header.kinematics)
        return [(f"{COMMAND}{name}", "data", role) for role, name in names.items()]

    def plan(self, run: Run, path: Floats | None) -> Iterator[_Entry]:
        """Yield target and planned path, as far as there are any; raise `FitError` if the start was not seen."""
        if not run.target.is_finite:
            return
        start, ns = start_pose(run).pose, self._ns(run, 0.0)
        yield _Entry(ns, TARGET, self._pose(ns, start.compose(run.target)))
        if path is not None:
            poses = [self._pose(self._ns(run, t_s), start.compose(Pose(*pose))) for t_s, *pose in path.tolist()]
            yield _Entry(ns, PLAN, self._new("nav_msgs/msg/Path", self._stamped(ns), poses))

    def _ns(self, run: Run, t_s: float) -> int:
        return self._began_ns + round(run.started_s * 1e9) + round(t_s * 1e9)

    def _pose(self, ns: int, pose: Pose) -> Any:
        half = pose.heading_rad / 2.0
        point = self._new("geometry_msgs/msg/Point", pose.x_m, pose.y_m, 0.0)
        turn = self._new("geometry_msgs/msg/Quaternion", 0.0, 0.0, float(np.sin(half)), float(np.cos(half)))
        content = self._new("geometry_msgs/msg/Pose", point, turn)
        return self._new("geometry_msgs/msg/PoseStamped", self._stamped(ns), content)

    def _stamped(self, ns: int) -> Any:
        stamp = self._new("builtin_interfaces/msg/Time", ns // 1_000_000_000, ns % 1_000_000_000)
        return self._new("std_msgs/msg/Header", stamp, FRAME)

    def _new(self, kind: str, *fields: Any) -> Any:
        return self.store.types[kind](*fields)


def _write(path: Path, entries: Sequence[_Entry], store: Typestore) -> Path:
    """Write a bag whole or not at all."""
    import shutil

    from rosbags.rosbag2 import StoragePlugin, Writer

    unfinished = path.parent / ".tmp-export"
    shutil.rmtree(unfinished, ignore_errors=True)
    bag = unfinished / path.name
    try:
        with Writer(bag, version=_METADATA_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
            connections: dict[str, Any] = {}
            for ns, topic, message in entries:
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=store)
                writer.write(connections[topic], ns, store.serialize_cdr(message, kind))
        bag.rename(path)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return path


def _write_mapping(path: Path, header: CampaignHeader, runs: Sequence[Run], messages: _Messages) -> Path:
    """Write the mapping that imports the bags as they were exported: one run for each."""
    import tomli_w

    rules = [
        {"match": _bag_path(path.parent, run).name}
        | {key: value for key in ("experiment", "trajectory", "condition", "firmware") if (value := getattr(run, key))}
        | ({"session": run.session} if run.session else {})
        for run in runs
    ]
    fields = {channel: {"topic": topic, "column": column} for topic, column, channel in messages.command_fields()}
    table = header.to_tables() | {
        "schema": 1,
        "pose": {"topic": POSE, "clock": "absolute"},
        "columns": fields,
        "runs": {"session": "campaign", "gap_s": _LONGEST_S, "shortest_s": 0.0},
        "files": rules,
    }
    write_atomically(path, tomli_w.dumps(table).encode(), durable=False)
    return path
