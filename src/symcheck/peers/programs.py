"""The peers: which are installed, how they are called, and how their answers are read."""

from __future__ import annotations

import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from symcheck.errors import SymcheckError, UsageError
from symcheck.operating_system import end_with_children
from symcheck.peers.storm_spelling import Spelling, storm_spelling
from symcheck.syntax.ast import Expression

__all__ = ["PEERS", "Answer", "Peer", "PeerError", "PeerName", "Question", "find_peer"]

PeerName = Literal["storm", "prism"]

Answer = bool | tuple[float, float]
"""A truth value, or the lowest and highest value over the initial states."""


class PeerError(SymcheckError):
    """A peer has given no answer; the message is its own."""


@dataclass(frozen=True)
class Question:
    """One property as the peers read it.

    Attributes:
        model: the file of the model.
        properties, number: the file of the properties, and which one is meant, from 1.
        formula, text: the same property, without constants and labels of the file.
        structures: the names of the reward structures of the model.
        model_constants, constants: values of the constants of the model, and of all.
    """

    model: Path
    properties: Path
    number: int
    formula: Expression
    text: str
    structures: Sequence[str | None]
    model_constants: Mapping[str, str]
    constants: Mapping[str, str]


@dataclass(frozen=True)
class Peer:
    """A model checker that is installed.

    Attributes:
        name: as it is shown.
        command: the words that start it with a question. Raises UnsupportedError: it has no such
            property.
        complements: whether its answer is 1 minus the value that is asked for.
    """

    name: str
    command: Callable[[Question], Sequence[str]]
    complements: Callable[[Question], bool] = lambda _: False

    def ask(self, question: Question, time_limit: float) -> Answer:
        """The answer of the peer; it is stopped after so many seconds.

        Raises PeerError. Raises UnsupportedError as `command` does.
        """
        command = self.command(question)
        try:
            # A session of its own: PRISM is a script that starts Java, and both must end.
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                start_new_session=True,
            )
        except OSError as error:
            raise PeerError(f"{self.name} cannot be started: {error.strerror}") from None
        try:
            output, _ = process.communicate(timeout=time_limit)
        except subprocess.TimeoutExpired:
            raise PeerError(f"no answer in {time_limit:g} seconds") from None
        finally:
            if process.poll() is None:
                end_with_children(process)
                process.communicate()
        answer = _read(output, process.returncode)
        if isinstance(answer, tuple) and self.complements(question):
            return 1 - answer[1], 1 - answer[0]
        return answer


_RESULT = re.compile(r"^Result(?: \([^)]*\))?: *(.*)$", re.MULTILINE)
_ERROR = re.compile(r"^(?:Error|ERROR)\b[^:]*: *(.*)$", re.MULTILINE)


_KIND = re.compile(r"^\w+(?:Exception|Error): +")
"""The class of an exception of Storm, before its message."""

_NO_MEMORY = "there is not enough memory"


def _ending(status: int) -> str:
    """How a program without a result and a message has ended."""
    if status >= 0:
        return f"it ended with status {status} and without a result"
    name = signal.Signals(-status).name
    reason = ": perhaps the memory is exhausted" if name == "SIGKILL" else ""
    return f"it was ended by {name}{reason}"


def _read(output: str, status: int) -> Answer:
    """The answer in the output of a peer. Raises PeerError."""
    results = _RESULT.findall(output)
    if not results:
        faults = _ERROR.findall(output) or [_ending(status)]
        raise PeerError(_NO_MEMORY if "bad_alloc" in faults[-1] else _KIND.sub("", faults[-1]))
    text = re.split(r" +\(", results[-1].strip())[0]
    if text in ("true", "false"):
        return text == "true"
    ends = text.strip("[]").split(",")
    try:
        values = [float(end) for end in ends]
    except ValueError:
        raise PeerError(f"its result is not a number: {text}") from None
    return values[0], values[-1]


def _assigned(constants: Mapping[str, str]) -> str:
    return ",".join(f"{n}={v}" for n, v in constants.items())


def _prism(words: Sequence[str]) -> Peer | None:
    program = shutil.which("prism")
    if program is None:
        return None

    def command(q: Question) -> list[str]:
        given = ["-const", _assigned(q.constants)] if q.constants else []
        return [program, str(q.model), str(q.properties), "-prop", str(q.number), *given, *words]

    return Peer("PRISM", command)


def _spelling(question: Question) -> Spelling:
    return storm_spelling(question.formula, question.text, question.structures)


def _storm(words: Sequence[str]) -> Peer | None:
    program = shutil.which("storm")
    if find_spec("stormpy") is not None and not words:
        worker = [sys.executable, "-P", str(Path(__file__).with_name("stormpy_run.py"))]

        def call(q: Question) -> list[str]:
            spelling = _spelling(q)
            given = _assigned(q.model_constants)
            return [*worker, str(q.model), spelling.text, given, *(spelling.filter or ())]

        return Peer("Storm", call, lambda q: _spelling(q).complement)
    if program is None:
        return None

    def command(q: Question) -> list[str]:
        given = ["--constants", _assigned(q.model_constants)] if q.model_constants else []
        text = _spelling(q).whole_text
        return [program, "--prism", str(q.model), "--prismcompat", "--prop", text, *given, *words]

    return Peer("Storm", command, lambda q: _spelling(q).complement)


PEERS: Mapping[str, tuple[Callable[[Sequence[str]], Peer | None], str]] = {
    "storm": (_storm, "there is no program storm in PATH, and no Python package stormpy"),
    "prism": (_prism, "there is no program prism in PATH"),
}
"""For each peer, how it is found, and what is missing if it is not."""


def find_peer(given: str) -> Peer:
    """The peer of a name; words after the name are switches of its program.

    Raises UsageError: the name is unknown, or the peer is not installed.
    """
    name, *words = shlex.split(given) or [""]
    if name not in PEERS:
        raise UsageError(f"there is no peer '{name}'; there are {', '.join(PEERS)}")
    find, missing = PEERS[name]
    peer = find(words)
    if peer is None:
        if words and find([]) is not None:
            missing = f"switches need the program {name}, and it is not in PATH"
        raise UsageError(f"{name} is not installed: {missing}")
    return peer
