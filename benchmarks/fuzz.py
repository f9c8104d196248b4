"""Fuzz a reader of texts or files, guided by coverage (atheris, CPython 3.11).

python benchmarks/fuzz.py TARGET FOLDER [-max_total_time=SECONDS …]

Targets are model, properties, tra, lab, drn, jani, umb and strategy. Words that begin with a dash
are those of libFuzzer. Any exception but symcheck's own errors is a fault. The first input of each
fault (a type, and a place in symcheck) is written into FOLDER with the traceback. A model is bound,
built if it is small, and printed and read again; a property is checked.
"""

from __future__ import annotations

import json
import re
import resource
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from random import Random
from types import FrameType
from typing import Any

import atheris

HERE = Path(__file__).resolve().parent.parent
PACKAGES = ("automata", "check", "exchange", "semantics", "syntax")
"""What is instrumented, for all of the program: modules are imported where they are used."""
FAILS = (  # in atheris 3.0
    "symcheck.exchange.formats.combined_file",
    "symcheck.exchange.formats.prism_writer",
)
MODULES = [
    ".".join(path.relative_to(HERE / "src").with_suffix("").parts)
    for path in (HERE / "src").rglob("*.py")
]
atheris.instrument_imports(
    include=["symcheck", "umbi"],
    exclude=[m for m in MODULES if m in FAILS or m.split(".")[1] not in PACKAGES],
).__enter__()
import symcheck  # noqa: E402
from symcheck.errors import InternalError, SymcheckError, TimeLimitError  # noqa: E402
from symcheck.semantics.binding.bind_model import undefined_constants  # noqa: E402
from symcheck.semantics.model import BoundModel  # noqa: E402

sys.path.insert(0, str(HERE / "tests"))
from generate import random_question, wild_model  # noqa: E402

MODEL = """mdp
const int N; const double p = 0.5;
module m
  s : [0..2] init 0; b : bool;
  [a] s=0 -> p : (s'=1) + 1-p : (s'=2);
  [b] s=0 -> (b'=true) & (s'=min(s+1, 2));
  [] s=1 -> true;
endmodule
module n = m [ s=t, b=c ] endmodule
label "a" = s=1; label "b" = s=2 | t=1;
rewards "r" s=1 : 2; [a] true : 3; endrewards
rewards "c" [b] true : 1; endrewards
"""
STRATEGY = """(0,false,0,false)=a
1=b
(0,true,0,false)=0.5:a+0.5:b
#memory:0
(0,false,0,false),0=a
#0,0->1
"""
SECONDS = 5
"""The longest time of one input; what takes longer is left."""
MEMORY = 8 << 30
"""Address space, in bytes."""

MOST_STATES = 1000
"""Of models and files that are built."""

TOKEN = re.compile(rb"\s+|[A-Za-z_]\w*|\d+(?:\.\d+)?|.", re.DOTALL)


def small(bound: BoundModel) -> bool:
    """Whether the variables allow few states."""
    states = 1
    for variable in bound.variables:
        states *= variable.high - variable.low + 1
    return states <= MOST_STATES


def model(text: str) -> None:
    """Bind, build and print a model."""
    program = symcheck.parse_model(text)
    assert symcheck.parse_model(symcheck.pretty(program)) == program, "printed otherwise"
    loaded = symcheck.loads(text, {c.name: 2 for c in undefined_constants(program)})
    if small(loaded.bound):
        _ = loaded.with_options(engine="explicit").engine


def properties(text: str) -> None:
    """Check and print properties."""
    file = symcheck.parse_properties(text)
    assert symcheck.parse_properties(symcheck.pretty(file)) == file, "printed otherwise"
    for _ in _LOADED.check_all(file):
        pass


def files(suffix: str, data: bytes, beside: str = "") -> None:
    """Read an explicit model, the `beside` of which is a transitions file."""
    path = FOLDER / f"x.{suffix}"
    path.write_bytes(data)
    if beside:
        (FOLDER / "x.tra").write_text(beside)
        suffix = f"tra,{suffix}"
    loaded = symcheck.load_explicit(str(FOLDER / f"x.{suffix}"), engine="explicit")
    loaded.check('P=? [ F "deadlock" ]')


def jani(data: bytes) -> None:
    """Read a JANI model."""
    path = FOLDER / "x.jani"
    path.write_bytes(data)
    loaded = symcheck.load(path)
    if small(loaded.bound):
        _ = loaded.with_options(engine="explicit").engine


def strategy(data: bytes) -> None:
    """Read a strategy of the model above."""
    path = FOLDER / "x.txt"
    path.write_bytes(data)
    symcheck.induced_chain(_LOADED, symcheck.load_strategy(_LOADED, path))


def exported(suffix: str) -> list[bytes]:
    """Files of some models."""
    out = []
    for seed in range(12):
        kind = ("dtmc", "ctmc", "mdp")[seed % 3]
        try:
            symcheck.export(
                symcheck.loads(wild_model(Random(seed), kind).text), str(FOLDER / f"x.{suffix}")
            )
        except SymcheckError:
            continue
        out += [p.read_bytes() for p in FOLDER.glob(f"*.{suffix}")]
    return out


def texts_of_models() -> list[bytes]:
    """Models of every feature."""
    from syntax import samples

    random = [wild_model(Random(i), ("dtmc", "ctmc", "mdp")[i % 3]).text for i in range(9)]
    return [t.encode() for t in (MODEL, samples.MODEL, *random)]


def texts_of_properties() -> list[bytes]:
    """Properties of every operator."""
    from syntax import samples

    small_model = wild_model(Random(1), "mdp")
    asked = [random_question(Random(i), small_model) for i in range(200)]
    known = [re.sub(r"\b[xyzc]\w*\d\b", "s", text) for text in asked]
    return [t.encode() for t in (samples.PROPERTIES, *known)]


def decoded(check: Callable[[str], None]) -> Callable[[bytes], None]:
    """A check of texts as one of bytes."""
    return lambda data: check(data.decode(errors="replace"))


TARGETS: dict[str, tuple[Callable[[bytes], None], Callable[[], list[bytes]]]] = {
    "model": (decoded(model), texts_of_models),
    "properties": (decoded(properties), texts_of_properties),
    "tra": (lambda d: files("tra", d), lambda: exported("tra")),
    "lab": (lambda d: files("lab", d, "3 3\n0 1 1\n1 2 1\n2 2 1\n"), lambda: exported("lab")),
    "drn": (lambda d: files("drn", d), lambda: exported("drn")),
    "umb": (lambda d: files("umb", d), lambda: exported("umb")),
    "jani": (jani, lambda: [(HERE / "models/die/die.jani").read_bytes(), *exported("jani")]),
    "strategy": (strategy, lambda: [STRATEGY.encode()]),
}


class Faults:
    """What was found: a file for each kind of fault."""

    def __init__(self, folder: Path, check: Callable[[bytes], None]) -> None:
        self.folder, self.check = folder, check
        self.known: set[tuple[str, str]] = set()

    def __call__(self, data: bytes) -> None:
        """Run one input."""
        signal.setitimer(signal.ITIMER_REAL, SECONDS)
        try:
            self.check(data)
        except InternalError as error:
            self._keep(data, error)
        except SymcheckError:
            pass
        except Exception as error:
            self._keep(data, error)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)

    def _keep(self, data: bytes, error: Exception) -> None:
        frames = traceback.extract_tb(error.__traceback__)
        ours = [f"{f.filename}:{f.lineno}" for f in frames if "symcheck" in f.filename]
        kind = (type(error).__name__, (ours or ["?"])[-1])
        if kind in self.known:
            return
        self.known.add(kind)
        name = self.folder / f"fault{len(self.known)}"
        name.with_suffix(".input").write_bytes(data)
        name.with_suffix(".txt").write_text("".join(traceback.format_exception(error)))
        print(f"fault {len(self.known)}: {kind[0]}: {error} at {kind[1]}", flush=True)


def kind(word: bytes) -> bytes:
    """What may stand where the word stands: another name, number or operator, or only itself."""
    if word[:1].isdigit():
        return b"number"
    if word in b"+-*/<>=&|!":
        return b"operator"
    return b"name" if len(word) < 3 and word[:1].isalpha() else word


def mutated(data: bytes, most: int, seed: int) -> bytes:
    """Words moved, repeated, left out or taken from another place; or what libFuzzer does."""
    rng = Random(seed)
    if rng.random() < 0.2:
        return bytes(atheris.Mutate(data, most))
    words = TOKEN.findall(data) or [b" "]
    for _ in range(rng.randint(1, 6)):
        at, length = rng.randrange(len(words)), rng.choice((1, 1, 1, 3, 10))
        match rng.choice((0, 1, 2, 3, *(4,) * 20)):
            case 0:
                del words[at : at + length]
            case 1:
                words[at:at] = WORDS[(i := rng.randrange(len(WORDS))) : i + length]
            case 2:
                words[at] = rng.choice(WORDS)
            case 3:
                other = rng.randrange(len(words))
                words[at:at] = words[other : other + length]
            case 4:  # what is likely to follow the grammar
                words[at] = rng.choice(ALIKE.get(kind(words[at]), [words[at]]))
        words = words or [b" "]
    return b"".join(words)[:most]


def mutated_json(data: bytes, most: int, seed: int) -> bytes:
    """A document with nodes replaced by others of any document, left out or changed."""
    rng = Random(seed)
    try:
        document = json.loads(data)
    except ValueError:
        return bytes(atheris.Mutate(data, most))
    for _ in range(rng.randint(1, 3)):
        places = list(_places(document))
        if not places:
            break
        parent, key = rng.choice(places)
        match rng.randrange(8):
            case 0:
                del parent[key]
            case 1:
                parent[key] = rng.choice((None, True, -1, 0.5, 1e400, 2**63, "", [], {}))
            case 2 if isinstance(parent, list):
                parent.insert(key, rng.choice(NODES))
            case 3 if isinstance(parent, dict):
                parent[rng.choice(KEYS)] = parent[key]
            case _:  # likely to have the type that is expected
                alike = [n for n in NODES if type(n) is type(parent[key])]
                parent[key] = rng.choice(alike or NODES)
        document = json.loads(json.dumps(document))  # nodes are shared
    out = json.dumps(document, separators=(",", ":")).encode()
    return out if len(out) <= most else data


def _places(node: object) -> Iterator[tuple[Any, Any]]:
    """Each node below this one, as its parent and its key or index."""
    items: Iterable[tuple[Any, Any]] = ()
    if isinstance(node, dict):
        items = node.items()
    elif isinstance(node, list):
        items = enumerate(node)
    for key, below in items:
        yield node, key
        yield from _places(below)


def stop(_number: int, _frame: FrameType | None) -> None:
    """End an input that takes too long."""
    raise TimeLimitError("too long")


if __name__ == "__main__":
    target, folder = sys.argv[1], Path(sys.argv[2])
    corpus = folder / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    FOLDER = Path(tempfile.mkdtemp())
    _LOADED = symcheck.loads(MODEL, "N=2", engine="explicit")
    check, samples = TARGETS[target]
    seeds = samples()
    WORDS = [w for text in seeds for w in TOKEN.findall(text)]
    WORDS += [
        b"-1",
        b"0",
        b"1e400",
        b"1e-400",
        b"99999999999",
        b"4294967296",
        b"nan",
        b"inf",
        b"\xff",
    ]
    ALIKE: dict[bytes, list[bytes]] = {}
    for word in WORDS:
        ALIKE.setdefault(kind(word), []).append(word)
    mutator = None if target == "umb" else mutated
    if target == "jani":
        documents = [json.loads(text) for text in seeds]
        NODES = [parent[key] for d in documents for parent, key in _places(d)]
        KEYS = sorted({key for d in documents for _, key in _places(d) if isinstance(key, str)})
        mutator = mutated_json
        seeds = [json.dumps(d, separators=(",", ":")).encode() for d in documents]
    for i, text in enumerate(seeds):
        (corpus / f"seed{i}").write_bytes(text)
    signal.signal(signal.SIGALRM, stop)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    most = max(4000, *(2 * len(text) for text in seeds))  # a longer text is cut
    arguments = [
        sys.argv[0],
        f"-max_len={most}",
        "-rss_limit_mb=0",  # what asks for more than there is has to end with a message
        "-timeout=60",
        f"-artifact_prefix={folder}/",
    ]
    atheris.Setup(
        [*arguments, *sys.argv[3:], str(corpus)],
        Faults(folder, check),
        custom_mutator=mutator,
    )
    atheris.Fuzz()
