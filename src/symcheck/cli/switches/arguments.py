"""The switches of the command line: PRISM's, with one dash or two.

Those that set an option come from the table in `symcheck.options`; those of input, files and output
are declared here.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn, TypeVar

from symcheck import __version__
from symcheck.cli.switches.prism_options import Adapted, adapt
from symcheck.errors import UsageError
from symcheck.options import (
    OPTIONS,
    Options,
    make_options,
    read_count,
    read_fraction,
    read_number,
)
from symcheck.syntax.ast import ModelType

__all__ = [
    "HELP_EPILOGUE",
    "ONE_FILE_SWITCHES",
    "Arguments",
    "Export",
    "information",
    "make_parser",
    "parse_arguments",
]

if TYPE_CHECKING:  # most runs do without
    from symcheck.cli.switches.switch_help import SwitchDescription

T = TypeVar("T")

_HELP = ("-help", "--help", "-?")

HELP_EPILOGUE = """\
Examples:
  symcheck die.pm                                  build the model, count its states
  symcheck die.pm die.pctl                         check every property of the file
  symcheck die.pm -pf 'P=? [ F d=6 ]'              check one property
  symcheck compare die.pm die.pctl -with storm     compare the answers with those of Storm
  symcheck -batch suite.txt -timeout 60            run each line of a file, 60 s at most for each
  symcheck crowds.pm crowds.pctl -const TotalRuns=3:6,CrowdSize=10 -exportresults table.csv

Switches of PRISM that have no effect here (-javamaxmem, -nopre, -gs and others) are accepted and
listed in the output. Every switch may be written with two dashes.

Exit status: 0 every property was answered (with -test: no test failed); 1 an error in the input, an
unsupported property, a failed test, or an output that cannot be written; 2 the command line is
wrong; 3 stopped by a limit of memory or time; 130 stopped by Ctrl-C, 143 by SIGTERM. With -batch:
0 if each line ended with 0, 1 if not, 2, 130 and 143 as above.
"""


class Export(NamedTuple):
    """A switch that writes a part of the model.

    kind: an extension, or 'model'. argument: FILE[:OPTIONS], or FILES[:OPTIONS] for 'model'.
    """

    kind: str
    argument: str


class Arguments(argparse.Namespace):
    """The parsed command line.

    Attributes:
        settings: the values of options that switches set.
        exports: the parts of the model to be written, in order.
        needs_model: the switches that need the built model.
        without_effect: the ignored switches of PRISM, with reasons.
        folder: that of -dir.
    """

    model: str | None
    properties: str | None
    pf: list[str]
    prop: str | None
    const: list[str]
    model_type: ModelType | None
    simpath: list[str] | None
    step: bool
    sim: bool
    simmethod: str
    simsamples: int | None
    simconf: float | None
    simwidth: float | None
    simapprox: float | None
    simvar: int
    simmaxrwd: float | None
    simpathlen: int
    seed: int | None
    importmodel: str | None
    importtrans: str | None
    importstates: str | None
    importlabels: str | None
    importstaterewards: str | None
    importtransrewards: str | None
    importinitdist: str | None
    exportdot: str | None
    exportpage: str | None
    exportprism: str | None
    exportprismconst: str | None
    exportprecision: int
    exportrows: bool
    noexportheaders: bool
    exportmatlab: bool
    transient: str | None
    steadystate: bool
    exporttransient: str | None
    exportsteadystate: str | None
    verbose: bool
    exportresults: str | None
    jobs: int
    scheduler: str | None
    exportstrat: str | None
    importstrat: str | None
    counterexample: bool
    exportcounterexample: str | None
    exportvector: list[str]
    exportprodtrans: str | None
    exportprodstates: str | None
    exportpareto: str | None
    nobuild: bool
    test: bool
    testall: bool
    exporttests: str | None
    mainlog: str | None
    batch: str | None
    help: str | None
    completion: str | None
    version: bool
    javaversion: bool
    peer: str | None

    def __init__(self, adapted: Adapted) -> None:
        super().__init__()
        self.settings: dict[str, object] = {}
        self.exports: list[Export] = []
        self.needs_model: list[str] = []
        self.without_effect: Mapping[str, str] = adapted.without_effect
        self.folder = adapted.folder

    @property
    def imports_model(self) -> bool:
        """Whether the model is read from explicit files."""
        return self.importmodel is not None or self.importtrans is not None

    @property
    def options(self) -> Options:
        """The options that the switches set. Raises UsageError."""
        files = {
            "strategy": self.exportstrat is not None,
            "everywhere": bool(self.exportvector),
        }
        settings = {**files, **self.settings}
        if self.draws_diagram and not settings.get("exact"):
            settings.setdefault("engine", "hybrid")
        return make_options(settings)

    @property
    def draws_diagram(self) -> bool:
        """Whether an export needs decision diagrams."""
        return self.exportdot is not None


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Help as wide as the terminal; argparse would import shutil to find the width."""

    def __init__(self, prog: str) -> None:
        try:
            width = os.get_terminal_size(1).columns
        except OSError:
            width = 120
        super().__init__(prog, width=max(width - 2, 60))

    def _format_action_invocation(self, action: argparse.Action) -> str:
        """The switch with one dash only; the epilogue says that two are accepted."""
        shown = copy(action)
        shown.option_strings = [
            name for name in action.option_strings if not name.startswith("--")
        ] or action.option_strings
        return super()._format_action_invocation(shown)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        # argparse names each spelling: "argument -e/--e: expected one argument".
        message = re.sub(r"^argument (-\w+)[^:]*:", r"\1:", message)
        message = message.replace("expected one argument", "expected a value")
        raise UsageError(f"{message}\n  hint: symcheck --help lists the switches")

    def add(self, name: str, *aliases: str, **keywords: Any) -> None:
        """A switch that is written with one dash, and with two as well."""
        names = [f"-{n}" for n in (name, *aliases)]
        names += [f"--{n}" for n in (name, *aliases) if len(n) > 1]
        self.add_argument(*names, **keywords)

    def switches(self) -> list[SwitchDescription]:
        """The switches, in the order of the help."""
        from symcheck.cli.switches.switch_help import SwitchDescription

        found = []
        for action in self._actions:
            names = [n for n in action.option_strings if not n.startswith("--")]
            values = action.metavar if isinstance(action.metavar, tuple) else (action.metavar,)
            if names:
                given = () if action.nargs == 0 else tuple(v for v in values if v)
                option = action.dest if isinstance(action, _SetOption) else ""
                found.append(SwitchDescription(tuple(names), given, action.help or "", option))
        return found

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


def _typed(read: Callable[[str], T]) -> Callable[[str], T]:
    """A reader of values as argparse wants it: its ValueError is the message."""

    def reader(text: str) -> T:
        try:
            return read(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return reader


@_typed
def _positive_count(text: str) -> int:
    value = read_count(text)
    if not value:
        raise ValueError("0 is too few")
    return value


@_typed
def _digits(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise ValueError(f"'{text}' is not a number of digits")
    return int(text)


@_typed
def _positive_number(text: str) -> float:
    value = read_number(text)
    if not 0 < value < float("inf"):
        raise ValueError(f"'{text}' is not a number above 0")
    return value


class _SetOption(argparse.Action):
    """Notes the value of an option of `symcheck.options` in `settings`."""

    def __init__(
        self, option_strings: Sequence[str], dest: str, *, value: object, **keywords: Any
    ) -> None:
        super().__init__(option_strings, dest, default=argparse.SUPPRESS, **keywords)
        self.value = value

    def __call__(
        self, _: object, arguments: argparse.Namespace, values: object, __: str | None = None
    ) -> None:
        """Note the value."""
        arguments.settings[self.dest] = values if self.value is None else self.value


class _BuiltModel(argparse.Action):
    """Stores the value of a switch that needs the built model, and notes the switch."""

    def __call__(
        self, _: object, arguments: argparse.Namespace, values: object, switch: str | None = None
    ) -> None:
        """Store the value."""
        setattr(arguments, self.dest, True if self.nargs == 0 else values)
        arguments.needs_model.append((switch or "").lstrip("-"))


class _BuiltModelFiles(_BuiltModel):
    """Appends the file of a switch that needs the built model."""

    def __call__(
        self, _: object, arguments: argparse.Namespace, values: object, switch: str | None = None
    ) -> None:
        """Append the file."""
        super().__call__(_, arguments, [*getattr(arguments, self.dest), values], switch)


class _ExportPart(argparse.Action):
    """Appends a part of the model to `exports`, one for each kind."""

    def __init__(
        self, option_strings: Sequence[str], dest: str, *, kinds: str, **keywords: Any
    ) -> None:
        super().__init__(option_strings, dest, default=argparse.SUPPRESS, **keywords)
        self.kinds = kinds.split()

    def __call__(
        self, _: object, arguments: argparse.Namespace, values: object, switch: str | None = None
    ) -> None:
        """Append the exports."""
        files = values if isinstance(values, list) else [values]
        arguments.exports += map(Export, self.kinds, files)
        arguments.needs_model.append((switch or "").lstrip("-"))


def _options(parser: _Parser, group: str) -> None:
    """The switches of the options of a group."""
    for option in OPTIONS:
        for switch in option.switches if option.group == group else ():
            takes_value = switch.value is None
            parser.add(
                *switch.names,
                dest=option.name,
                action=_SetOption,
                value=switch.value,
                nargs=None if takes_value else 0,
                type=_typed(option.values.read) if takes_value else None,
                metavar=option.values.metavar if takes_value else None,
                help=switch.help,
            )


def _input(parser: _Parser) -> None:
    parser.add_argument(
        "model",
        nargs="?",
        metavar="MODEL",
        help="model file (.pm .prism .sm .nm … .jani); - reads it from the standard input",
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
    for kind in ModelType:
        parser.add(
            kind.value,
            dest="model_type",
            action="store_const",
            const=kind,
            help=f"read the model as {'an' if kind is ModelType.MDP else 'a'} {kind.name}",
        )


def _simulation(parser: _Parser) -> None:
    parser.add(
        "simpath",
        metavar=("PATH", "FILE"),
        nargs=2,
        help="write a random path ('stdout' prints it). PATH: steps, time=T or deadlock, and "
        ",vars=(x,…) sep=comma|space|tab rewards= probs= changes= loopcheck= snapshot=T repeat=N",
    )
    parser.add(
        "step",
        action="store_true",
        help="step through the model: shows the state and its choices, reads which one to take",
    )
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
        type=_positive_count,
        help="number of paths (default: 1000, or what -simwidth needs)",
    )
    parser.add(
        "simconf",
        metavar="X",
        type=_typed(read_fraction),
        help="probability that interval or verdict are wrong (default: 0.01)",
    )
    parser.add(
        "simwidth",
        metavar="W",
        type=_positive_number,
        help="half the width of the interval; what sprt tells apart (default: 0.05)",
    )
    parser.add(
        "simapprox",
        metavar="W",
        type=_positive_number,
        help="the same, by the name that it has for apmc",
    )
    parser.add(
        "simvar",
        metavar="N",
        type=_typed(read_count),
        default=1000,
        help="paths from which -simwidth judges the variance (default: 1000)",
    )
    parser.add(
        "simmaxrwd",
        metavar="X",
        type=_positive_number,
        help="the largest reward that a path can earn, for apmc",
    )
    parser.add(
        "simpathlen",
        metavar="N",
        type=_typed(read_count),
        default=10_000,
        help="the longest path (default: 10000)",
    )
    parser.add(
        "seed",
        "simseed",
        metavar="N",
        type=_typed(read_count),
        help="seed of the random numbers (default: a new one, which is reported)",
    )


def _imports(parser: _Parser) -> None:
    parser.add(
        "importmodel",
        metavar="BASE.all",
        help="read the model from BASE.tra, .sta, .lab, .srew, .trew (or BASE.tra,sta,…), from a "
        "file .drn or .umb; files .gz and .xz are compressed",
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
        "importstrat",
        metavar="FILE",
        help="follow the strategy in FILE (as -exportstrat writes it): check, simulate and export "
        "the chain that it induces on an mdp",
    )
    parser.add(
        "importinitdist",
        metavar="FILE",
        help="initial distribution for -transient and -steadystate: a probability per line",
    )


def _exports(parser: _Parser) -> None:
    parser.add(
        "exportmodel",
        metavar="FILES[:OPTIONS]",
        action=_ExportPart,
        kinds="model",
        help="write the model: out.tra,sta,lab,srew,trew; out.all; out.dot; out.drn; out.umb; "
        "out.jani; "
        "'stdout' for out prints. "
        "OPTIONS: actions, headers, rows, states, proplabels (=false), precision=N",
    )
    for name, kind, what in (
        ("trans", "tra", "transitions"),
        ("states", "sta", "states"),
        ("labels", "lab", "labels"),
        ("staterewards", "srew", "state rewards"),
        ("transrewards", "trew", "transition rewards"),
        ("transdot", "dot", "graph, in DOT"),
        ("transdotstates", "dotstates", "graph with the values of the variables, in DOT"),
        ("sccs", "sccs", "strongly connected components"),
        ("bsccs", "bsccs", "bottom strongly connected components"),
        ("mecs", "mecs", "maximal end components of an MDP"),
        ("jani", "jani", "model with the values of its constants, and the properties, as JANI"),
    ):
        parser.add(
            f"export{name}",
            metavar="FILE",
            action=_ExportPart,
            kinds=kind,
            help=f"write the {what}",
        )
    parser.add(
        "exportrewards",
        metavar="FILE",
        nargs=2,
        action=_ExportPart,
        kinds="srew trew",
        help="write state and transition rewards",
    )
    parser.add(
        "exportproplabels",
        metavar="FILE",
        nargs="?",
        const="",
        action=_ExportPart,
        kinds="proplab",
        help="write the labels of the properties (without FILE: with the labels of the model)",
    )
    parser.add(
        "exportdot",
        metavar="FILE",
        action=_BuiltModel,
        help="write the matrix as a decision diagram, in DOT (default engine: -h)",
    )
    parser.add(
        "exportpage",
        metavar="FILE",
        action=_BuiltModel,
        help="write an HTML page: state graph, values, simulator, and a player for each stage",
    )
    parser.add("exportprism", metavar="FILE", help="write the text of the model")
    parser.add(
        "exportprismconst",
        metavar="FILE",
        action=_BuiltModel,
        help="write the text of the model with the values of its constants",
    )
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
        "noexportheaders", action="store_true", help="no comments at the top of exported files"
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
        action=_BuiltModel,
        help="distribution over the states at a time (DTMC: a step), or at times low:step:high",
    )
    parser.add(
        "steadystate",
        "ss",
        nargs=0,
        default=False,
        action=_BuiltModel,
        help="distribution over the states in the long run",
    )
    parser.add(
        "exporttransient",
        "exporttr",
        metavar="FILE",
        action=_BuiltModel,
        help="write the probabilities of -transient, a line per state",
    )
    parser.add(
        "exportsteadystate",
        "exportss",
        metavar="FILE",
        action=_BuiltModel,
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
        help="write the results: .csv .json .parquet, plots .png .svg .pdf; or by KIND text "
        "(default), csv, matrix, dataframe, comment, json ('stdout' for FILE prints)",
    )
    parser.add(
        "jobs",
        metavar="N",
        type=_positive_count,
        default=1,
        help="check models with different constants in N processes at the same time (default: 1)",
    )
    parser.add(
        "scheduler",
        metavar="ADDRESS",
        help="check them on the workers of a Dask cluster; ADDRESS is that of its scheduler, such "
        "as tcp://host:8786",
    )
    parser.add(
        "exportstrat",
        metavar="FILE[:type=KIND]",
        action=_BuiltModel,
        help="write a strategy of each mdp property: actions (default), indices, induced, dot; "
        "the induced chain also as FILE.tra,sta,lab or FILE.all",
    )
    parser.add(
        "exportvector",
        metavar="FILE",
        action=_BuiltModelFiles,
        default=[],
        help="write the value of each property in every state, a line per state; several switches "
        "write several files",
    )
    parser.add(
        "counterexample",
        action="store_true",
        help="show why a bound P<=p [...] is false or true: likeliest paths, and few commands",
    )
    parser.add(
        "exportcounterexample",
        metavar="FILE",
        action=_BuiltModel,
        help="write them: .txt, .json or .dot",
    )
    for part, what in (("trans", "transitions"), ("states", "states")):
        parser.add(
            f"exportprod{part}",
            metavar="FILE",
            action=_BuiltModel,
            help=f"write the {what} of the product with the automaton of each LTL property",
        )
    parser.add(
        "exportpareto",
        metavar="FILE",
        help="write the Pareto front of a multi(...) query: .csv (vertices) or .json (also its "
        "half-spaces); 'stdout' prints",
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
    parser.add(
        "exporttests",
        metavar="FILE",
        help="write the outcome of -test or -testall: .xml (JUnit) or .json",
    )
    parser.add(
        "with",
        dest="peer",
        metavar="PEER",
        help="symcheck compare MODEL PROPERTIES -with PEER: compare the answers with those of "
        "storm or prism, if it is installed ('prism -s' gives it switches)",
    )
    parser.add(
        "batch",
        metavar="FILE",
        help="run each line of FILE (MODEL PROPERTIES switches) as if alone, in a process that has "
        "started already; - reads the lines from the standard input",
    )
    parser.add("mainlog", metavar="FILE", help="write the output to a file")
    parser.add(
        "help", "?", metavar="SWITCH", nargs="?", const="", help="this text, or what a switch does"
    )
    parser.add(
        "completion",
        metavar="SHELL",
        help="print a script that completes switches in a shell: bash, zsh, fish",
    )
    parser.add("version", action="store_true", help="the version")
    parser.add("javaversion", action="store_true", help="the version of Python: there is no Java")


def make_parser() -> _Parser:
    """The parser of the switches."""
    parser = _Parser(
        prog="symcheck",
        usage="symcheck MODEL [PROPERTIES] [switches]",
        description="Checks probabilistic models (DTMC, CTMC, MDP in the PRISM language or JANI) "
        "against PCTL, CSL and LTL properties.",
        epilog=HELP_EPILOGUE,
        formatter_class=_Formatter,
        add_help=False,
        allow_abbrev=False,
    )
    _input(parser)
    _options(parser, "method")
    _options(parser, "model")
    for group in (
        _simulation,
        _imports,
        _exports,
        _distributions,
        _output,
    ):
        group(parser)
    return parser


def information(arguments: Arguments) -> str | None:
    """The text that -help, -completion, -version or -javaversion asks for. Raises UsageError."""
    if arguments.version:
        return f"symcheck {__version__}"
    if arguments.javaversion:
        number = ".".join(map(str, sys.version_info[:3]))
        return f"Python {number}: symcheck needs no Java virtual machine"
    if arguments.help is None and arguments.completion is None:
        return None
    from symcheck.cli.switches.switch_help import completion, explain

    parser = make_parser()
    if arguments.help is not None:
        switch = arguments.help
        return explain(switch, parser.switches()) if switch else parser.format_help().rstrip()
    return completion(arguments.completion or "", parser.switches()).rstrip()


def parse_arguments(words: Sequence[str]) -> Arguments:
    """The parsed command line. Raises UsageError."""
    parser = make_parser()
    if len(words) == 2 and words[0] in _HELP:
        words = [f"-help={words[1].lstrip('-')}"]  # also where the switch has its dash
    compares = bool(words) and words[0] == "compare"
    adapted = adapt(words[1:] if compares else words, parser.counts())
    arguments = parser.parse_args(adapted.words, Arguments(adapted))
    if compares != (arguments.peer is not None):
        hint = "symcheck compare MODEL PROPERTIES -with storm (or -with prism)"
        missing = "compare needs a peer" if compares else "-with is a switch of compare"
        raise UsageError(f"{missing}\n  hint: {hint}")
    for switch in ONE_FILE_SWITCHES:
        if sum(word.split("=", 1)[0].lstrip("-") == switch for word in adapted.words) > 1:
            raise UsageError(
                f"-{switch} is given twice, and one file is written\n  hint: name one file"
            )
    if compares:
        refused = [s for s in (*ONE_FILE_SWITCHES, *_NOT_COMPARED) if getattr(arguments, s)]
        if refused:
            raise UsageError(f"compare prints a table of answers, and does not take -{refused[0]}")
    return arguments


ONE_FILE_SWITCHES = (
    *("exportstrat", "exportresults", "exportpage", "exportcounterexample", "exportpareto"),
    *("exporttests", "exportprodtrans", "exportprodstates"),
)
"""The switches that name one file."""

_NOT_COMPARED = (
    *("exports", "exportvector", "exportdot", "counterexample", "sim", "simpath", "step"),
    *("test", "testall", "transient", "steadystate"),
)
"""Further switches of what `compare` does not do."""
