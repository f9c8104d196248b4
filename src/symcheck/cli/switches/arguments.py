"""The switches of the command line: PRISM's, with one dash or two.

Those that set an option come from the table in `symcheck.options`; those of input, files and output
are declared in `input_switches` and `output_switches`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from functools import cache

from symcheck.cli.switches.input_switches import (
    add_imports,
    add_input,
    add_options,
    add_simulation,
)
from symcheck.cli.switches.needs import COMPARE, PROPERTY, Given, unmet_needs
from symcheck.cli.switches.output_switches import add_distributions, add_exports, add_output
from symcheck.cli.switches.parser import Export, HelpFormatter, SwitchParser
from symcheck.cli.switches.prism_options import Adapted, adapt
from symcheck.errors import UsageError
from symcheck.options import Options, make_options
from symcheck.syntax.ast import ModelType
from symcheck.version import __version__

__all__ = ["HELP_EPILOGUE", "Arguments", "information", "make_parser", "parse_arguments"]

_HELP = ("-help", "--help", "-?")

HELP_EPILOGUE = """\
Examples:
  symcheck die.pm                                  build the model, count its states
  symcheck die.pm die.pctl                         check every property of the file
  symcheck die.pm -pf 'P=? [ F d=6 ]'              check one property
  symcheck compare die.pm die.pctl -with storm     compare the answers with those of Storm
  symcheck workbench die.pm die.pctl               edit, check and draw the model in the browser
  symcheck -batch suite.txt -timeout 60            run each line of a file, 60 s at most for each
  symcheck crowds.pm crowds.pctl -const TotalRuns=3:6,CrowdSize=10 -exportresults table.csv

Switches of PRISM that have no effect here (-javamaxmem, -nopre, -gs and others) are accepted and
listed in the output. Every switch may be written with two dashes.

Exit status: 0 every property was answered (with -test: no test failed); 1 an error in the input, an
unsupported property, a failed test, or an output that cannot be written; 2 the command line is
wrong; 3 stopped by a limit of memory or time; 130 stopped by Ctrl-C, 143 by SIGTERM. With -batch:
0 if each line ended with 0, 1 if not, 2, 130 and 143 as above.
"""


class Arguments(argparse.Namespace):
    """The parsed command line.

    Attributes:
        settings: the values of options that switches set.
        exports: the parts of the model to be written, in order.
        given: the switches by their usual names.
        without_effect: the ignored switches of PRISM, with reasons.
        folder: that of -dir.
    """

    model: str | None
    properties: str | None
    pf: list[str]
    prop: str | None
    const: list[str]
    param: list[str]
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
    importresults: str | None
    jobs: int
    scheduler: str | None
    distributed: bool
    checkpoints: str | None
    resume: str | None
    exportstrat: str | None
    importstrat: str | None
    counterexample: bool
    exportcounterexample: str | None
    counterexamplepaths: int | None
    exportvector: list[str]
    exportprodtrans: str | None
    exportprodstates: str | None
    exportpareto: str | None
    exportregions: str | None
    exportcertificate: str | None
    exportiterations: str | None
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
        self.given: dict[str, Given] = {}
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
    def asks_information(self) -> bool:
        """Whether a text is asked for, and no run."""
        requested = self.help is not None or self.completion is not None
        return requested or self.version or self.javaversion

    @property
    def needs_model(self) -> bool:
        """Whether a switch needs the built model."""
        return any(switch.needs.model for switch in self.given.values())

    @property
    def about_states(self) -> list[str]:
        """The switches that need the built model, and not its text or the result of a property."""
        texts = {"-exportprismconst", "-exportjani"}
        models = [e.argument.partition(":")[0] for e in self.exports if e.kind == "model"]
        if all(name.endswith(".jani") for name in models):
            texts.add("-exportmodel")
        switches = (s for n, s in self.given.items() if n not in texts)
        return [s.written for s in switches if s.needs.model and PROPERTY not in s.needs.all_of]

    @property
    def draws_diagram(self) -> bool:
        """Whether an export needs decision diagrams."""
        return self.exportdot is not None


def make_parser() -> SwitchParser:
    """The parser of the switches."""
    parser = SwitchParser(
        prog="symcheck",
        usage="symcheck MODEL [PROPERTIES] [switches]",
        description="Checks probabilistic models (Markov chains, decision processes, Markov and "
        "timed automata, games and hidden states, in the PRISM language or JANI) against PCTL, CSL "
        "and LTL properties.",
        epilog=HELP_EPILOGUE,
        formatter_class=HelpFormatter,
        add_help=False,
        allow_abbrev=False,
    )
    add_input(parser)
    add_options(parser, "method")
    add_options(parser, "model")
    for group in (add_simulation, add_imports, add_exports, add_distributions, add_output):
        group(parser)
    return parser


_parser = cache(make_parser)
"""The parser that the lines of a batch share."""


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
    return completion(arguments.completion or "", parser, parser.switches()).rstrip()


def parse_arguments(words: Sequence[str]) -> Arguments:
    """The parsed command line. Raises UsageError."""
    parser = _parser()
    if len(words) == 2 and words[0] in _HELP:
        words = [f"-help={words[1].lstrip('-')}"]  # also where the switch has its dash
    compares = bool(words) and words[0] == "compare"
    adapted = adapt(words[1:] if compares else words, parser.counts())
    arguments = parser.parse_args(adapted.words, Arguments(adapted))
    arguments.given = parser.given(adapted.words)
    if compares and arguments.help is not None:
        arguments.help = arguments.help or "compare"
        return arguments
    if compares != (arguments.peer is not None):
        raise UsageError(
            "compare needs a peer" if compares else "-with is a switch of compare",
            hint="symcheck compare MODEL PROPERTIES -with storm (or -with prism)",
        )
    if compares:
        arguments.given[COMPARE] = Given("compare", arguments.given[COMPARE].needs)
    for unmet in unmet_needs(arguments.given, {}):
        if not unmet.note and not arguments.asks_information:
            raise unmet.error
    return arguments
