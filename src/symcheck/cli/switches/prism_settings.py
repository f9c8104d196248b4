"""-settings FILE: the settings that PRISM's graphical interface saves, as switches.

A line is `name=value`. The file holds every setting: one with PRISM's default asks for nothing.
Source: the section "Configuring PRISM" of the PRISM manual.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from symcheck.errors import UsageError

__all__ = ["SavedSettings", "read_settings"]


@dataclass(frozen=True)
class SavedSettings:
    """The settings of a file.

    words: the switches that they amount to. without_effect: the names of those that change nothing
    here. unknown: the names `prism.…` that are not known.
    """

    words: tuple[str, ...]
    without_effect: tuple[str, ...]
    unknown: tuple[str, ...] = ()


def _with_value(switch: str) -> Callable[[str], list[str]]:
    return lambda value: [switch, value]


def _one_of(**words: str) -> Callable[[str], list[str]]:
    return lambda value: [words[value.lower()]]


_HONOURED: Mapping[str, tuple[str, Callable[[str], list[str]]]] = {
    "prism.engine": ("Hybrid", _one_of(mtbdd="-m", sparse="-s", hybrid="-h", explicit="-ex")),
    "prism.exact.enabled": ("false", _one_of(true="-exact")),
    "prism.termCrit": ("Relative", _one_of(absolute="-absolute")),
    "prism.termCritParam": ("1.0E-6", _with_value("-epsilon")),
    "prism.maxIters": ("10000", _with_value("-maxiters")),
    "prism.fairness": ("false", _one_of(true="-fair")),
    "prism.fixDeadlocks": ("true", _one_of(false="-nofixdl")),
    "prism.doProbChecks": ("true", _one_of(false="-noprobchecks")),
    "prism.cuddMaxMem": ("1g", _with_value("-cuddmaxmem")),
    "prism.verbose": ("false", _one_of(true="-v")),
    "prism.ltl2daTool": ("", _with_value("-ltl2datool")),
    "prism.ltl2daSyntax": ("LBT", lambda value: ["-ltl2dasyntax", value.lower()]),
    "prism.exportModelPrecision": ("16", _with_value("-exportmodelprecision")),
    "prism.exportModelHeaders": ("true", _one_of(false="-noexportheaders")),
    "simulator.defaultNumSamples": ("1000", _with_value("-simsamples")),
    "simulator.defaultConfidence": ("0.01", _with_value("-simconf")),
    "simulator.defaultMaxPath": ("10000", _with_value("-simpathlen")),
}
"""Default of a setting, and the switches for another value."""

_REFUSED: Mapping[str, tuple[str, str]] = {
    "prism.param.enabled": ("false", "parametric model checking is not supported"),
    "prism.exportIterations": ("false", "-exportiterations FILE writes iterations"),
    "prism.exportParetoFilename": ("", "-exportpareto FILE writes the front"),
    "prism.exportParetoFileName": ("", "-exportpareto FILE writes the front"),
    "prism.exportAdv": ("None", "-exportadv FILE and -exportadvmdp FILE write an adversary"),
}
"""Default of a setting that asks for something else, and why it is refused."""

_METHODS: Mapping[str, str] = {
    "prism.symmRedParams": "",
    "prism.linEqMethod": "Jacobi",
    "prism.linEqMethodParam": "0.9",
    "prism.mdpSolnMethod": "Value iteration",
    "prism.mdpMultiSolnMethod": "Value iteration",
    "prism.imdpSolnMethod": "Gauss-Seidel",
    "prism.topologicalVI": "false",
    "prism.pmaxQuotient": "false",
    "prism.intervalIter": "false",
    "prism.intervalIterOptions": "",
    "prism.transientMethod": "Uniformisation",
    "prism.precomputation": "true",
    "prism.prob0": "true",
    "prism.prob1": "true",
    "prism.preRel": "true",
    "prism.sumRoundOff": "1.0E-5",
    "prism.doSSDetect": "true",
    "prism.multiMaxIters": "50",
    "prism.multiMaxPoints": "50",
    "prism.paretoEpsilon": "0.01",
}
"""Settings of the way of computing, with their defaults: results are certified here."""

_STORAGE = (
    *("compact", "doReorder", "reorderOptions", "explodeBits", "globalizeVariables"),
    *("cuddEpsilon", "cuddMaxGrowth", "ddExtraStateVars", "ddExtraActionVars", "ddsanity"),
    *("numSBLevels", "SBMaxMem", "numSORLevels", "SORMaxMem", "extraDDInfo", "extraReachInfo"),
    *("sccMethod", "sccMethodExplicit", "ecMethod", "ptaMethod", "arOptions", "pathViaAutomata"),
    *("noDaSimplify", "exportAdvFilename", "boundsViaCounters", "allowLTL2WDBA"),
    *("gridResolution", "heuristic", "javaMaxMem", "javaStack"),
)
"""Settings `prism.…` of how PRISM stores or prepares something, or details of those above."""

_GROUPS = ("prism.param.", "prism.fau.")
"""Groups of settings that are details of those above."""

_WINDOWS = ("gui", "log", "model", "prism", "properties", "property", "simulator")
"""What the names of settings begin with."""


def read_settings(path: str) -> SavedSettings:
    """The settings of a file. Raises UsageError."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not a UTF-8 text"
        raise UsageError(f"-settings: cannot read '{path}': {reason}") from None
    words: list[str] = []
    ignored: list[str] = []
    unknown: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        name, equals, value = (part.strip() for part in line.partition("="))
        if not equals or name.startswith("#"):
            continue
        where = f"-settings: {path}:{number}: {name}={value}"
        if name.partition(".")[0] not in _WINDOWS:
            raise UsageError(f"{where}: there is no such setting of PRISM")
        if name in _HONOURED:
            default, switches = _HONOURED[name]
            try:
                words += [] if _same(value, default) else switches(value)
            except KeyError:
                raise UsageError(f"{where}: there is no such value of this setting") from None
        elif name in _REFUSED:
            default, reason = _REFUSED[name]
            if not _same(value, default):
                raise UsageError(f"{where}: {reason}")
        elif name in _METHODS:
            if not _same(value, _METHODS[name]):
                ignored.append(name)
        elif name.startswith("prism.") and not name.startswith(_GROUPS):
            if name.removeprefix("prism.") not in _STORAGE:
                unknown.append(name)
    return SavedSettings(tuple(words), tuple(ignored), tuple(unknown))


def _same(value: str, default: str) -> bool:
    """Whether a value is the default: as a number, or as a word in any case."""
    try:
        return float(value) == float(default)
    except ValueError:
        return value.casefold() == default.casefold()
