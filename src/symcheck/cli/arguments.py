"""The switches of the command line: PRISM's, with one dash or two."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Sequence
from copy import copy
from typing import Any, NoReturn

from symcheck.cli.prism_options import adapt
from symcheck.errors import UsageError

__all__ = ["HELP_EPILOGUE", "parse_arguments"]

HELP_EPILOGUE = """\
Examples:
  symcheck die.pm                                  build the model, count its states
  symcheck die.pm die.pctl                         check every property of the file
  symcheck die.pm -pf 'P=? [ F d=6 ]'              check one property
  symcheck crowds.pm crowds.pctl -const TotalRuns=3:6,CrowdSize=10 -exportresults table.csv:csv

Switches of PRISM that have no meaning here (-javamaxmem, -nopre, -gs and others) are accepted, and named in the output.
Every switch may be written with two dashes as well.

Exit status: 0 all answered (and all tests passed); 1 something was not: an error in the input, an unsupported
property, a failed test; 2 the command line is wrong; 3 stopped by a limit of memory or time; 130 stopped by Ctrl-C.
"""


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """As wide as the terminal; argparse would import shutil and all its archive formats to find that out."""

    def __init__(self, prog: str) -> None:
        try:
            width = os.get_terminal_size(1).columns
        except OSError:
            width = 120
        super().__init__(prog, width=max(width - 2, 60))

    def _format_action_invocation(self, action: argparse.Action) -> str:
        """With one dash only: that two are the same is said once."""
        shown = copy(action)
        shown.option_strings = [
            name for name in action.option_strings if not name.startswith("--")
        ] or action.option_strings
        return super()._format_action_invocation(shown)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}\n  hint: symcheck --help lists the switches")

    def add(self, name: str, *aliases: str, **keywords: Any) -> None:
        """A switch that is written with one dash, and with two as well."""
        names = [f"-{n}" for n in (name, *aliases)]
        names += [f"--{n}" for n in (name, *aliases) if len(n) > 1]
        self.add_argument(*names, **keywords)

    def counts(self) -> dict[str, int]:
        """For each switch, how many words follow it; -1 for one that may be missing."""
        return {
            name: action.nargs
            if isinstance(action.nargs, int)
            else -1
            if action.nargs == "?"
            else 1
            for action in self._actions
            for name in action.option_strings
        }


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number") from None


def _count(text: str) -> int:
    """A whole number, plain (10000) or in scientific notation (1e6)."""
    value = _number(text)
    if not 0 <= value < float("inf") or value != int(value):
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 0")
    return int(text) if text.isdigit() else int(value)


def _some(text: str) -> int:
    """A whole number from 1."""
    value = _count(text)
    if not value:
        raise argparse.ArgumentTypeError("0 is too few")
    return value


def _memory(text: str) -> int:
    """Bytes from PRISM's notation: 512m, 4g, 100k, or a plain number of kilobytes."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kmg]?)b?", text.lower())
    if match is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not an amount of memory such as 512m or 4g")
    return int(float(match[1]) * {"": 1 << 10, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30}[match[2]])


def _seconds(text: str) -> float:
    """Seconds from 90, 90s, 5m, 1h or 1d."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([smhd]?)", text.lower())
    if match is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not a time such as 90, 90s, 5m or 1h")
    seconds = float(match[1]) * {"": 1, "s": 1, "m": 60, "h": 3600, "d": 86400}[match[2]]
    if seconds == 0:
        raise argparse.ArgumentTypeError(
            "no time at all is not enough; leave the switch out for no limit"
        )
    return seconds


def _digits(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of digits")
    return int(text)


def _positive(text: str) -> float:
    value = _number(text)
    if not 0 < value < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number between 0 and 1")
    return value


def _width(text: str) -> float:
    value = _number(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number above 0")
    return value


def _input(parser: _Parser) -> None:
    parser.add_argument(
        "model", nargs="?", metavar="MODEL", help="model file (.pm .prism .sm .nm …)"
    )
    parser.add_argument(
        "properties", nargs="?", metavar="PROPERTIES", help="properties file (.pctl .csl .props …)"
    )
    parser.add(
        "pf",
        "pctl",
        "csl",
        metavar="TEXT",
        action="append",
        default=[],
        help="properties given as text",
    )
    parser.add(
        "prop",
        "property",
        metavar="N,N-N,NAME",
        help="only these properties, by number (from 1), range of numbers or name",
    )
    parser.add(
        "const",
        metavar="X=V,…",
        action="append",
        default=[],
        help="constants: values, lists {a,b}, ranges low:high or low:step:high",
    )
    for kind in ("dtmc", "ctmc", "mdp"):
        parser.add(
            kind,
            dest="model_type",
            action="store_const",
            const=kind,
            help=f"read the model as a {kind.upper()}",
        )


def _methods(parser: _Parser) -> None:
    for name, aliases, engine, text in (
        ("m", ("mtbdd",), "mtbdd", "diagrams for matrix and vectors"),
        ("h", ("hybrid",), "hybrid", "diagrams for the matrix (as blocks), arrays for vectors"),
        ("s", ("sparse",), "sparse", "diagrams to build, then a sparse matrix"),
        ("ex", ("explicit",), "explicit", "no diagrams at all"),
    ):
        parser.add(
            name,
            *aliases,
            dest="engine",
            action="store_const",
            const=engine,
            help=f"{engine} engine: {text}",
        )
    parser.add(
        "method",
        metavar="NAME",
        default="auto",
        help="numerical method (default: chosen by structure)",
    )
    parser.add("exact", action="store_true", help="rational arithmetic")
    parser.add(
        "epsilon",
        "e",
        metavar="X",
        type=_positive,
        default=1e-6,
        help="width of the certified interval (default: 1e-6)",
    )
    parser.add(
        "relative",
        "rel",
        dest="relative",
        action="store_true",
        default=True,
        help="epsilon is relative (default)",
    )
    parser.add("absolute", "abs", dest="relative", action="store_false", help="epsilon is absolute")
    parser.add(
        "maxiters",
        metavar="N",
        type=_count,
        default=1_000_000,
        help="iterations of one numerical solution at most",
    )
    parser.add(
        "estimate",
        action="store_true",
        help="stop when values change little; faster, and certifies nothing",
    )
    parser.add(
        "fair",
        dest="fairness",
        action="store_true",
        default=False,
        help="only fair strategies of an MDP",
    )
    parser.add("nofair", dest="fairness", action="store_false", help="all strategies (default)")
    parser.add(
        "bisim",
        action="store_true",
        default=False,
        help="check on the quotient by strong bisimulation",
    )
    parser.add(
        "ltl2datool",
        metavar="PROGRAM",
        help="external translator from LTL to automata: PROGRAM formula-file HOA-file",
    )
    parser.add(
        "ltl2dasyntax",
        metavar="SYNTAX",
        default="lbt",
        help="how it reads formulas: lbt (default), spin, spot, rabinizer",
    )


def _model(parser: _Parser) -> None:
    parser.add(
        "fixdl",
        dest="fix_deadlocks",
        action="store_true",
        default=True,
        help="give deadlocks a self-loop (default)",
    )
    parser.add("nofixdl", dest="fix_deadlocks", action="store_false", help="a deadlock is an error")
    parser.add(
        "noprobchecks",
        dest="check_sums",
        action="store_false",
        default=True,
        help="accept probabilities that do not sum to 1",
    )
    parser.add(
        "reduce",
        action="store_true",
        help="reset variables that nothing will read again: fewer states",
    )
    parser.add(
        "order",
        metavar="X,Y,…|force|sift",
        help="variables from the top of the diagrams down, or how to look for an order",
    )
    parser.add(
        "cuddmaxmem",
        metavar="SIZE",
        type=_memory,
        help="memory of diagrams, or of an explicit search, at most, such as 4g",
    )
    parser.add(
        "timeout",
        metavar="TIME",
        type=_seconds,
        help="time of the run at most, such as 90, 5m or 1h",
    )


def _simulation(parser: _Parser) -> None:
    parser.add(
        "simpath", metavar=("PATH", "FILE"), nargs=2, help="write a random path ('stdout' prints it). PATH: steps, time=T or deadlock, "
        "and ,vars=(x,…) sep=comma|space|tab rewards= probs= changes= loopcheck= snapshot=T repeat=N",
    )  # fmt: skip
    parser.add(
        "sim",
        action="store_true",
        help="estimate P and R properties from random paths; the model is not built",
    )
    parser.add(
        "simmethod",
        metavar="NAME",
        default="ci",
        help="ci (default), aci, apmc: intervals; sprt: a test, for thresholds",
    )
    parser.add(
        "simsamples",
        metavar="N",
        type=_some,
        help="number of paths (default: 1000, or what -simwidth needs)",
    )
    parser.add(
        "simconf",
        metavar="X",
        type=_positive,
        help="probability that interval or verdict are wrong (default: 0.01)",
    )
    parser.add(
        "simwidth",
        metavar="W",
        type=_width,
        help="half the width of the interval; what sprt tells apart (default: 0.05)",
    )
    parser.add(
        "simapprox", metavar="W", type=_width, help="the same, by the name that it has for apmc"
    )
    parser.add(
        "simvar",
        metavar="N",
        type=_count,
        default=1000,
        help="paths from which -simwidth judges the variance (default: 1000)",
    )
    parser.add(
        "simmaxrwd",
        metavar="X",
        type=_width,
        help="the largest reward that a path can earn, for apmc",
    )
    parser.add(
        "simpathlen",
        metavar="N",
        type=_count,
        default=10_000,
        help="the longest path (default: 10000)",
    )
    parser.add(
        "seed",
        "simseed",
        metavar="N",
        type=_count,
        help="seed of the random numbers (default: a new one, which is reported)",
    )


def _imports(parser: _Parser) -> None:
    parser.add(
        "importmodel",
        metavar="BASE.all",
        help="read the model from BASE.tra, .sta, .lab, .srew, .trew (or BASE.tra,sta,…)",
    )
    for name, what in (
        ("trans", "transitions (.tra)"),
        ("states", "states (.sta)"),
        ("labels", "labels (.lab)"),
        ("staterewards", "state rewards (.srew)"),
        ("transrewards", "transition rewards (.trew)"),
    ):
        parser.add(f"import{name}", metavar="FILE", help=f"read the {what} of a model")
    parser.add(
        "importinitdist",
        metavar="FILE",
        help="initial distribution for -transient and -steadystate: a probability per line",
    )


def _exports(parser: _Parser) -> None:
    parser.add(
        "exportmodel", metavar="FILES[:OPTIONS]", action="append", default=[], help="write the model: out.tra,sta,lab,srew,trew; out.all; "
        "out.dot; out.drn; out.umb; 'stdout' for out prints. OPTIONS: actions, headers, rows, states, proplabels (=false), precision=N",
    )  # fmt: skip
    for name, what in (
        ("trans", "transitions"),
        ("states", "states"),
        ("labels", "labels"),
        ("staterewards", "state rewards"),
        ("transrewards", "transition rewards"),
        ("transdot", "graph, in DOT"),
        ("transdotstates", "graph with the values of the variables, in DOT"),
        ("dot", "matrix as a decision diagram, in DOT (engines -m, -h, -s)"),
        ("sccs", "strong components"),
        ("bsccs", "bottom strong components"),
        ("mecs", "maximal end components of an MDP"),
        ("prism", "model as a text again"),
        ("prismconst", "model as a text, with the values of its constants"),
    ):
        parser.add(f"export{name}", metavar="FILE", help=f"write the {what}")
    parser.add("exportrewards", metavar="FILE", nargs=2, help="write state and transition rewards")
    parser.add(
        "exportprecision",
        "exportmodelprecision",
        metavar="N",
        type=_digits,
        default=17,
        help="digits of written numbers (17: all)",
    )
    parser.add("exportrows", action="store_true", help="write transitions with a line per row")
    parser.add(
        "noexportheaders", action="store_true", help="no comments at the top of reward files"
    )
    parser.add(
        "exportproplabels",
        metavar="FILE",
        nargs="?",
        const="",
        help="write the labels of the properties (without FILE: to the other labels)",
    )
    parser.add(
        "exportmatlab",
        action="store_true",
        help="write matrices, rewards, states and labels for Matlab",
    )


def _distributions(parser: _Parser) -> None:
    parser.add(
        "transient",
        "tr",
        metavar="T",
        help="distribution over the states at a time (DTMC: a step), or at times low:step:high",
    )
    parser.add(
        "steadystate",
        "ss",
        action="store_true",
        help="distribution over the states in the long run",
    )
    parser.add(
        "exporttransient",
        "exporttr",
        metavar="FILE",
        help="write the probabilities of -transient, a line per state",
    )
    parser.add(
        "exportsteadystate",
        "exportss",
        metavar="FILE",
        help="write the probabilities of -steadystate, a line per state",
    )


def _output(parser: _Parser) -> None:
    parser.add(
        "v",
        "verbose",
        dest="verbose",
        action="store_true",
        help="tell more: iterations, methods, diagrams",
    )
    parser.add(
        "exportresults",
        metavar="FILE[:KIND]",
        help="write the results: text (default), csv, matrix, dataframe, comment or json; 'stdout' for FILE prints",
    )
    parser.add(
        "exportstrat",
        metavar="FILE[:type=KIND]",
        help="write a strategy of each mdp property: actions (default), indices, induced, dot",
    )
    parser.add(
        "exportvector",
        metavar="FILE",
        help="write the value of each property in every state, a line per state",
    )
    parser.add("nobuild", action="store_true", help="only read the model")
    parser.add(
        "test",
        action="store_true",
        help="compare with the RESULT lines; stop at the first that fails",
    )
    parser.add(
        "testall", action="store_true", help="compare with the RESULT lines; go on after a failure"
    )
    parser.add("help", "?", action="help", help="this text")
    parser.add_argument("-version", "--version", action="store_true", help="the version")


def _parser() -> _Parser:
    parser = _Parser(
        prog="symcheck",
        usage="symcheck MODEL [PROPERTIES] [switches]",
        description="Checks probabilistic models (DTMC, CTMC, MDP in the PRISM language) against PCTL, CSL and LTL properties.",
        epilog=HELP_EPILOGUE,
        formatter_class=_Formatter,
        add_help=False,
        allow_abbrev=False,
    )
    for group in (
        _input,
        _methods,
        _model,
        _simulation,
        _imports,
        _exports,
        _distributions,
        _output,
    ):
        group(parser)
    return parser


def parse_arguments(words: Sequence[str]) -> argparse.Namespace:
    """The command line as a namespace. Raises UsageError; `--help` prints and exits with 0.

    Beside the switches: `without_effect` (switches of PRISM that were left out, with reasons) and `folder` (of -dir).
    """
    parser = _parser()
    adapted = adapt(words, parser.counts())
    found = parser.parse_args(adapted.words)
    found.without_effect, found.folder = adapted.without_effect, adapted.folder
    return found
