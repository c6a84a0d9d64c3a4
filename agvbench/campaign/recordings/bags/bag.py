"""A bag of ROS 1 or ROS 2: its topics and, one by one, its messages. Whatever is wrong with it is one line."""

from __future__ import annotations

import resource
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from agvbench.errors import AgvbenchError, FileError
from agvbench.text_files import read_text, require_regular

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.typesys.store import Typestore

METADATA = "metadata.yaml"
_FILES = (".bag", ".mcap", ".db3")
MAX_BYTES = 4 << 30
"""Of memory that reading a bag may take: a few kB may decompress into TB."""
MAX_TEMPORARY_BYTES = 64 << 30
_REINDEX = "restore it from a copy, or repair it (ros2 bag reindex, mcap recover, rosbag reindex)"


def is_bag(path: Path) -> bool:
    """Whether `path` is a bag by its name: a directory, or a file ``.bag``, ``.mcap`` or ``.db3``."""
    return path.is_dir() or path.suffix in _FILES


class Message(NamedTuple):
    """A decoded message, its topic, and when it was recorded [ns since 1970]."""

    topic: str
    received_ns: int
    content: Any


@dataclass(frozen=True)
class Topic:
    """A topic of a bag: its name, the type of its messages, and how many there are."""

    name: str
    type: str
    count: int


class Bag:
    """A bag that is open while its context lasts; messages are decoded as they are asked for.

    Parameters
    ----------
    path
        A directory of rosbag2 with SQLite or MCAP files, one such file, or a ``.bag`` of ROS 1.

    Raises
    ------
    FileError
        If rosbags is not installed, or the bag is missing, foreign, damaged or takes more memory than it may.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self._files = _files_of(self.path)
            stack.enter_context(_limited_memory())
            self._reader = self._open(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _open(self, stack: ExitStack) -> Any:
        self.is_ros1 = self.path.suffix == ".bag" and not self.path.is_dir()
        reader_class = _reader_class(self.path, is_ros1=self.is_ros1)
        with self._readable():
            reader = reader_class(self.path)
            stack.enter_context(reader)
            self._connections: list[Connection] = list(reader.connections)
        return reader

    @property
    def files(self) -> tuple[Path, ...]:
        """The files of the bag."""
        return self._files

    @property
    def topics(self) -> list[Topic]:
        """The topics, in order of their names."""
        names = sorted({connection.topic for connection in self._connections})
        return [self._topic(name) for name in names]

    @property
    def duration_s(self) -> float:
        """The time between the first and the last message [s]."""
        return float(self._reader.duration) * 1e-9

    def _topic(self, name: str) -> Topic:
        own = [connection for connection in self._connections if connection.topic == name]
        if len(types := sorted({connection.msgtype for connection in own})) > 1:
            remedy = "give a bag with one type"
            raise FileError(f"topic {name} has several types", where=self.path, value=", ".join(types), remedy=remedy)
        return Topic(name, types[0], sum(connection.msgcount for connection in own))

    def topic(self, name: str) -> Topic:
        """Return a topic by its name; raise `FileError` if there is none, or it has no messages."""
        if name not in (names := [topic.name for topic in self.topics]):
            has = ", ".join(names[:20]) or "no topics"
            remedy = "correct the mapping's topics"
            raise FileError(f"has no topic {name} (it has {has})", where=self.path, remedy=remedy)
        if not (found := self._topic(name)).count:
            raise FileError(f"topic {name} has no messages", where=self.path, remedy="give a bag that has some")
        return found

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """Yield the messages of `topics` in the order in which they were recorded.

        Raises
        ------
        FileError
            If the bag is damaged, or the definition of a type is missing or cannot be used.
        """
        chosen = [connection for connection in self._connections if connection.topic in topics]
        with self._readable():
            store = self._types(chosen)
            decode = store.deserialize_ros1 if self.is_ros1 else store.deserialize_cdr
            for connection, received_ns, raw in self._reader.messages(chosen):
                yield Message(connection.topic, received_ns, decode(raw, connection.msgtype))

    def _types(self, connections: Collection[Connection]) -> Typestore:
        from agvbench.campaign.recordings.bags.definitions import typestore_for

        return typestore_for(connections, self.path, is_ros1=self.is_ros1)

    @contextmanager
    def _readable(self) -> Iterator[None]:
        """Turn what rosbags raises into one line: for a damaged bag that may be any exception, of its libraries too."""
        try:
            yield
        except AgvbenchError:
            raise
        except MemoryError:
            raise FileError("takes too much memory to read", where=self.path, remedy=_REINDEX) from None
        except Exception as error:  # noqa: BLE001 - see above
            reason = " ".join(str(error).split())[:160] or type(error).__name__
            raise FileError(f"is no bag that can be read ({reason})", where=self.path, remedy=_REINDEX) from None


def _reader_class(path: Path, *, is_ros1: bool) -> Any:
    try:
        if is_ros1:
            from rosbags.rosbag1 import Reader as Reader1

            return Reader1
        from rosbags.rosbag2 import Reader as Reader2
    except ImportError:
        remedy = "pip install 'agvbench[ros]'"
        raise FileError("is a ROS bag, for which rosbags is not installed", where=path, remedy=remedy) from None
    return Reader2


def _files_of(path: Path) -> tuple[Path, ...]:
    """Return the files of a bag, none of which is a pipe or a device."""
    try:
        if not path.is_dir():
            require_regular(path)
            return (path,)
        files = tuple(sorted(file for file in path.iterdir() if not file.is_dir()))
        for file in files:
            require_regular(file)
        read_text(path / METADATA)  # which is short
    except OSError as error:
        is_missing = path.is_dir() and isinstance(error, FileNotFoundError)
        what = f"has no {METADATA}, so it is no bag" if is_missing else f"cannot be read ({error.strerror})"
        raise FileError(what, where=path, remedy="give a bag, or create the file with ros2 bag reindex") from None
    except UnicodeDecodeError:
        raise FileError("is not UTF-8 text", where=path / METADATA, remedy=_REINDEX) from None
    return files


@contextmanager
def _limited_memory() -> Iterator[None]:
    """Let this process take at most `MAX_BYTES` more while the context lasts, and write files to a limit.

    The libraries that read bags decompress whatever the file says; beyond the limit they raise `MemoryError`.
    """
    limits = {kind: resource.getrlimit(kind) for kind in (resource.RLIMIT_DATA, resource.RLIMIT_FSIZE)}
    for (kind, (soft, hard)), wanted in zip(limits.items(), (_taken() + MAX_BYTES, MAX_TEMPORARY_BYTES), strict=True):
        lower = [limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY]
        resource.setrlimit(kind, (min([wanted, *lower]), hard))
    try:
        yield
    finally:
        for kind, limit in limits.items():
            resource.setrlimit(kind, limit)


def _taken() -> int:
    """Return the bytes that count against the limit now: the sixth number of ``statm``, in pages (proc(5))."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5]) * resource.getpagesize()
