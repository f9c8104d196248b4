"""Switches of PRISM that are ignored, translated or refused: its scripts run unchanged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from symcheck.errors import UsageError
from symcheck.lazy_dataclass import dataclass

__all__ = ["Adapted", "adapt", "ignored_switches", "refused_switches"]

_METHODS = "the method is chosen by structure, and results are certified; -method NAME forces one"
_MEMORY = "there is no Java virtual machine; -cuddmaxmem limits the memory of diagrams"
_ANALYSIS = "precomputation (Prob0/Prob1) is always done"
_STORAGE = "the representation is chosen by size"
_OTHER = "there is nothing that corresponds to it"

_GROUPS: tuple[tuple[str, int, str], ...] = (
    (
        "power pow pwr jacobi jac gaussseidel gs bgaussseidel bgs pgaussseidel pgs "
        "bpgaussseidel bpgs",
        0,
        _METHODS,
    ),
    (
        "jor sor bsor psor bpsor valiter politer modpoliter topological intervaliter ii linprog "
        "lp pmaxquotient",
        0,
        _METHODS,
    ),
    (
        "omega transientmethod heuristic fauepsilon faudelta fauarraythreshold "
        "fauintervals fauinitival",
        1,
        _METHODS,
    ),
    ("multimaxpoints paretoepsilon", 1, _METHODS),
    ("javamaxmem javastack javaparams", 1, _MEMORY),
    ("nopre noprob0 noprob1 noprerel zerorewardcheck nossdetect ssdetect", 0, _ANALYSIS),
    ("sccmethod", 1, _ANALYSIS),
    ("nocompact ddsanity extraddinfo extrareachinfo exportordered ordered", 0, _STORAGE),
    ("sbl sbmax gsl sorl gsmax sormax cuddepsilon ddextrastatevars ddextraactionvars", 1, _STORAGE),
    ("pathviaautomata nodasimplify simmanual ng", 0, _OTHER),
    ("aroptions sumroundoff", 1, _OTHER),
    ("symm", 1, "symmetric modules are found automatically; -nosymmetry explores every state"),
)
_WITHOUT_EFFECT: Mapping[str, tuple[int, str]] = {
    name: (count, why) for names, count, why in _GROUPS for name in names.split()
}

_PARAMETRIC = "functions of parameters are exact; -regions gives the share that is decided"
_PARAMETRIC_SWITCHES = (
    "paramprecision paramsplit parambisim paramfunction paramelimorder paramrandompoints "
    "paramsubsumeregions paramdagmaxerror"
)

_REFUSED: Mapping[str, str] = {
    **dict.fromkeys(_PARAMETRIC_SWITCHES.split(), _PARAMETRIC),
    "importpepa": "PEPA is not supported: models are in the PRISM language",
    "exportmrmc": "MRMC's formats are not supported; "
    "-exportmodel writes .tra .lab .srew .trew .pexp .drn and .umb",
    "settings": "files of settings are not read; the switches of the same meaning are, such as "
    "-epsilon, -maxiters, -fair and -simsamples",
    "exportunordered": "exports are always in the order of rows",
    "exportprodvector": "values in a product with an automaton are not exported; -exportprodtrans "
    "and -exportprodstates write the product, -exportvector the values in the model",
    "exporttarget": "targets are not exported; -exportlabels exports labels",
    **dict.fromkeys(
        ("exportobs", "importobs"),
        "files of observations are not supported; -exportmodel and -importmodel FILE.drn have them",
    ),
}


def ignored_switches() -> dict[str, str]:
    """The switches of PRISM that have no effect, with one dash, and why."""
    return {f"-{name}": why for name, (_, why) in _WITHOUT_EFFECT.items()}


def refused_switches() -> dict[str, str]:
    """The switches of PRISM that are not supported, with one dash, and what is."""
    return {f"-{name}": why for name, why in _REFUSED.items()}


@dataclass(frozen=True)
class Adapted:
    """An adapted command line.

    words: for the parser. without_effect: the ignored switches, with reasons. folder: of -dir.
    """

    words: list[str]
    without_effect: Mapping[str, str]
    folder: str | None = None


def adapt(words: Sequence[str], values: Mapping[str, int]) -> Adapted:
    """Remove the switches of PRISM that have no effect from a command line, and translate others.

    Args:
        words: the command line.
        values: the switches of the parser, with dashes, and how many words follow each (-1: one,
            unless it is a switch).

    Raises:
        UsageError: a switch is unknown or not supported.
    """
    kept: list[str] = []
    files: list[str] = []
    without: dict[str, str] = {}
    folder = None
    rest = _Words(words)
    while (word := rest.take()) is not None:
        if word.startswith("-help="):
            kept.append(word)
            continue
        name = word.lstrip("-") if word.startswith("-") and not _is_number(word) else None
        if word in values:
            kept += _joined(word, rest.following(values[word]))
        elif not name:
            files.append(word)
        elif (plain := name.partition(":")[0]) in _WITHOUT_EFFECT:
            count, why = _WITHOUT_EFFECT[plain]
            rest.following(count)
            without[f"-{plain}"] = why
        elif name in ("exportadv", "exportadvmdp"):
            mode = "reduce" if name == "exportadv" else "restrict"
            kept += [
                "-exportstrat",
                *(f"{path}:type=induced,mode={mode}" for path in rest.following(1)),
            ]
        elif name == "dir":
            folder = rest.take()
        elif name in _REFUSED:
            raise UsageError(f"-{name}: {_REFUSED[name]}")
        else:
            raise UsageError(
                f"there is no switch {word}",
                hint=f"{_hint(word, values)}symcheck --help lists the switches",
            )
    if len(files) > 2:
        raise UsageError(
            f"'{files[2]}' is one file too many: a run has a model file and a properties file; "
            "-pf gives more properties",
            hint=_unquoted(words),
        )
    # Files come first: argparse does not accept optional positional words between switches.
    return Adapted([*files, *kept], without, folder)


def _unquoted(words: Sequence[str]) -> str | None:
    """A hint at a property that the shell has split into words."""
    if "[" not in words:
        return None
    opening = words.index("[")
    end = words.index("]", opening) + 1 if "]" in words[opening:] else len(words)
    text = " ".join(words[max(opening - 1, 0) : end])
    return f"quote a property: -pf '{text}'"


class _Words:
    """The words of a command line, consumed one after the other."""

    def __init__(self, words: Sequence[str]) -> None:
        self._waiting = list(reversed(words))

    def take(self) -> str | None:
        return self._waiting.pop() if self._waiting else None

    def following(self, count: int) -> list[str]:
        """The next words; for -1 the next one unless it is a switch."""
        if count < 0:
            count = 1 if self._waiting and not self._waiting[-1].startswith("-") else 0
        return [word for _ in range(count) if (word := self.take()) is not None]


def _joined(switch: str, following: list[str]) -> list[str]:
    """A switch and its words; a value that looks like a switch (`-pf "-x>0"`) is joined to it."""
    if len(following) == 1 and following[0].startswith("-"):
        return [f"{switch}={following[0]}"]
    return [switch, *following]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


_STORM = {
    "engine": "-ex, -s, -h and -m choose an engine",
    "prism": "the model needs no switch: symcheck MODEL PROPERTIES",
    "jani": "the model needs no switch: symcheck MODEL.jani PROPERTIES",
    "prismcompat": "the models of PRISM are read as PRISM reads them",
    "explicit-drn": "the model needs no switch: symcheck MODEL.drn PROPERTIES",
    "sound": "bounds are proved without a switch, and -exact computes with fractions",
    "buildfull": "the whole model is built, unless -nostates is given",
    "eqsolver": "-method chooses the numerical method",
    "minmax:method": "-method chooses the numerical method",
    "precision": "-epsilon sets the precision",
    "exportscheduler": "-exportstrat FILE writes the strategy",
}
"""What is meant by the switches of Storm that have no counterpart of the same name."""


def _hint(word: str, known: Mapping[str, int]) -> str:
    from difflib import get_close_matches

    if hint := _STORM.get(word.lstrip("-").partition("=")[0]):
        return f"{hint}; "
    near = get_close_matches(word, known, 1, 0.75)
    return f"did you mean {near[0]}? " if near else ""
