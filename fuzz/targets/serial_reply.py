"""What a vehicle says at a serial port; the first byte says where the greeting ends and commands begin."""

from __future__ import annotations

from collections.abc import Iterable

from agvbench.types import Command
from fuzz.target import Target

_PIECE = 7


class SerialReply(Target):
    """A length of greeting, and bytes from the line, in pieces as they arrive."""

    name = "serial_reply"
    instruments = ("agvbench.adapters.serial_line",)
    longest = 512

    def __init__(self) -> None:
        from agvbench.adapters.serial_line.conversation import Conversation
        from agvbench.adapters.serial_line.lines import MAX_LINE

        self._conversation, self._longest_line = Conversation, MAX_LINE

    def seeds(self) -> Iterable[bytes]:
        """Return conversations with both versions of the firmware."""
        from agvbench.adapters.serial_line.lines import encode_line

        for version, unit in ((1, "deg"), (2, "us")):
            hello = encode_line(f"V agvbench {version} 1 {unit} none", checksum=version == 2)
            for said in ("ok 1", "err 1 3", "err 0 7", "W", "Q 1500 1500 1500 0 1"):
                yield bytes([len(hello)]) + hello + encode_line(said, checksum=version == 2) * 3
            yield bytes([len(hello)]) + hello * 2

    def feed(self, data: bytes) -> None:
        """Greet, command, and hear the rest."""
        conversation, cut = self._conversation("port"), 1 + (data[0] if data else 0)
        conversation.receive(data[1:cut], 0.0)
        conversation.begin()
        conversation.command(Command(1700.0, 1500.0, 1500.0), 0.0)
        for start in range(cut, len(data), _PIECE):
            conversation.receive(data[start : start + _PIECE], 0.1)
            assert len(conversation._splitter.unfinished) <= self._longest_line
        conversation.check(0.2)
