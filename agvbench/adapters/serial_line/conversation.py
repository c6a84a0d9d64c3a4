"""A conversation with the firmware: what to send, what the answers mean, and when to give up. It never waits."""

from __future__ import annotations

import math
from collections.abc import Iterator

from agvbench.adapters.serial_line.dialect import DIALECTS, Dialect, dialect_of
from agvbench.adapters.serial_line.lines import LineSplitter, decode_line, encode_line
from agvbench.adapters.serial_line.replies import Accepted, ErrorCode, Hello, Refused, Reply, WatchdogBit, parse_reply
from agvbench.errors import LinkError
from agvbench.types import Command

ANSWER_LIMIT_S = 0.25
"""A command is 30 bytes and its answer 15: 4 ms on the wire. When this has passed, the vehicle has stopped itself."""
ATTEMPTS = 3
_NUMBERS = 65535
_NOISE = frozenset((ErrorCode.BYTES, ErrorCode.CHECKSUM, ErrorCode.LENGTH))


class Conversation:
    """One end of the line.

    It begins with a greeting, in which anything may be heard: half a line of before, a boot loader, the firmware's
    own banner. After `begin`, everything that is heard must make sense.

    Parameters
    ----------
    where
        The port, for messages.

    Attributes
    ----------
    garbled, resent, watchdog_bites
        How many lines were garbled, commands said again, and times the vehicle's watchdog stopped it.
    bitten_after_s
        The longest time [s] between two commands around the last of these.
    """

    def __init__(self, where: str) -> None:
        self.hello: Hello | None = None
        self.garbled = self.resent = self.watchdog_bites = 0
        self._where, self._splitter = where, LineSplitter()
        self._checked = False  # whether the firmware has answered with a checksum: from then on it insists on them
        self._dialect: Dialect | None = None
        self._sequence, self._failures = 0, 0
        self._waiting: tuple[int, float] | None = None  # the oldest number without an answer, and when it was sent
        self._last: Command | None = None
        self._sent_s, self._gap_s, self.bitten_after_s = math.inf, 0.0, 0.0
        self._heard = b""

    @property
    def is_greeted(self) -> bool:
        """Whether the vehicle has identified itself, and both ends use checksums if both know them."""
        if self.hello is None:
            return False
        dialect = DIALECTS.get(self.hello.firmware_version)
        return self._checked or dialect is None or not dialect.checksums

    def greeting(self, attempt: int) -> bytes:
        """Return the query of the vehicle's identity: with a checksum, then without, for a firmware that knows none.

        The newline before ends whatever half line the vehicle has kept from before.
        """
        return b"\n" + encode_line("V", checksum=self.hello is not None or attempt % 2 == 0)

    def begin(self) -> Hello:
        """End the greeting; return the vehicle's identity.

        Raises
        ------
        LinkError
            If there was no answer, or that of another device or of a firmware that agvbench does not know.
        """
        if self.hello is not None:
            self._dialect = dialect_of(self.hello, where=self._where)
            return self.hello
        if self._heard + self._splitter.unfinished:
            raise LinkError(
                "this is not the firmware of a model AGV",
                where=self._where,
                value=repr((self._heard or self._splitter.unfinished).decode("ascii", "replace")[:40]),
                remedy="see whether it is the right port, and flash firmware/",
            )
        raise LinkError(
            "the vehicle does not answer", where=self._where, remedy="see whether it is switched on and the right port"
        )

    @property
    def watchdog_s(self) -> float | None:
        """After how long [s] without a command the vehicle stops itself; None if it does not."""
        return None if self._dialect is None else self._dialect.watchdog_s

    def command(self, command: Command, now_s: float) -> bytes:
        """Return the line that makes the vehicle hold `command` [µs], said at `now_s` [s]."""
        if self._dialect is None:
            raise LinkError("no vehicle was greeted", where=self._where)
        numbers = self._dialect.numbers(command, where=self._where)
        self._sequence = self._sequence % _NUMBERS + 1
        self._last = command
        self._gap_s, self._sent_s = max(0.0, now_s - self._sent_s), now_s
        self._waiting = self._waiting or (self._sequence, now_s)
        text = f"S {self._sequence} {numbers[0]} {numbers[1]} {numbers[2]}"
        return encode_line(text, checksum=self._dialect.checksums)

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Take what arrived at `now_s` [s]; return what has to be said again, if anything.

        Raises
        ------
        LinkError
            If the firmware refuses a command, keeps losing bytes, or was reset.
        """
        again = b""
        for reply in self._replies(data):
            again = self._take(reply, now_s) or again
        return again

    def check(self, now_s: float) -> None:
        """Raise `LinkError` if an answer is overdue."""
        if self._waiting is not None and now_s - self._waiting[1] > ANSWER_LIMIT_S:
            raise LinkError(
                "the vehicle does not answer any more",
                where=self._where,
                value=f"command {self._waiting[0]} for {now_s - self._waiting[1]:.2f} s",
                limit=f"{ANSWER_LIMIT_S:g} s",
                remedy="see the cable and the vehicle's battery",
            )

    def _replies(self, data: bytes) -> Iterator[Reply]:
        for line in self._splitter.feed(data):
            reply = self._reply(line.removesuffix(b"\r"))
            if reply is not None:
                self._checked |= b"*" in line
                yield reply
            elif line:
                self.garbled += 1
                self._heard = line

    def _reply(self, line: bytes) -> Reply | None:
        text = decode_line(line, checksum=self._dialect is not None and self._dialect.checksums)
        if text is not None:
            return parse_reply(text)
        # A firmware that has just been reset knows of no checksums, and its greeting must not be taken for noise.
        bare = decode_line(line, checksum=False)
        reply = None if bare is None else parse_reply(bare)
        return reply if isinstance(reply, Hello) else None

    def _take(self, reply: Reply, now_s: float) -> bytes:
        if self._dialect is None:
            self.hello = reply if isinstance(reply, Hello) else self.hello
        elif isinstance(reply, Accepted):
            self._accept(reply.sequence)
        elif isinstance(reply, Refused):
            return self._refuse(reply, now_s)
        elif isinstance(reply, WatchdogBit):
            # The next command may have been said before the vehicle's word for the silence before it was read.
            self.watchdog_bites += 1
            self.bitten_after_s = max(self._gap_s, now_s - self._sent_s)
        elif isinstance(reply, Hello):
            raise LinkError(
                "the vehicle was reset while it was driven",
                where=self._where,
                remedy="see its battery: a drop in voltage resets it",
            )
        return b""

    def _accept(self, sequence: int) -> None:
        """Count everything up to `sequence` as answered: a superseded command needs no answer of its own."""
        self._failures = 0
        if self._waiting is not None and (sequence - self._waiting[0]) % _NUMBERS < _NUMBERS // 2:
            self._waiting = None

    def _refuse(self, refused: Refused, now_s: float) -> bytes:
        self._failures += 1
        if refused.code in _NOISE and self._failures < ATTEMPTS and self._last is not None:
            self.resent += 1
            return self.command(self._last, now_s)
        raise LinkError(
            f"the vehicle refused a line: {refused.code.meaning}",
            where=self._where,
            value=f"err {refused.sequence} {refused.code.value}",
            limit=f"{ATTEMPTS} in a row" if refused.code in _NOISE else None,
            remedy="see the cable" if refused.code in _NOISE else None,
        )
