"""The switches of exports, distributions and output."""

from __future__ import annotations

from symcheck.cli.switches.needs import BATCH, COMPARE, PROPERTY, VALUES, Needs
from symcheck.cli.switches.parser import ExportPart, SwitchParser, digits, positive_count, typed
from symcheck.options import read_count

__all__ = ["add_distributions", "add_exports", "add_output"]

_MODEL = Needs(not_with=(BATCH,), model=True)
_RESULT = Needs((PROPERTY,), not_with=(BATCH,), model=True)
_PARTS = (
    "-exportmodel|-exporttrans|-exportstates|-exportlabels|-exportstaterewards|-exporttransrewards"
    "|-exportrewards|-exporttransdot|-exporttransdotstates|-exportproplabels|-exportjani"
)
_VECTORS = "-exportvector|-exportprodtrans"


def add_exports(parser: SwitchParser) -> None:
    """The switches that write the model."""
    parser.add(
        "exportmodel",
        needs=_MODEL,
        metavar="FILES[:OPTIONS]",
        action=ExportPart,
        kinds="model",
        help="write the model: out.tra,sta,lab,srew,trew; out.all; out.pexp; out.dot; "
        "out.drn; out.umb; out.umbt; out.jani; "
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
            action=ExportPart,
            kinds=kind,
            help=f"write the {what}",
            needs=_MODEL,
        )
    parser.add(
        "exportrewards",
        needs=_MODEL,
        metavar="FILE",
        nargs=2,
        action=ExportPart,
        kinds="srew trew",
        help="write state and transition rewards",
    )
    parser.add(
        "exportproplabels",
        needs=_MODEL,
        metavar="FILE",
        nargs="?",
        const="",
        action=ExportPart,
        kinds="proplab",
        help="write the labels of the properties (without FILE: with the labels of the model)",
    )
    parser.add(
        "exportdot",
        needs=_MODEL,
        metavar="FILE",
        help="write the matrix as a decision diagram, in DOT (default engine: -h)",
    )
    parser.add(
        "exportpage",
        needs=_MODEL,
        metavar="FILE",
        help="write an HTML page: state graph, values, simulator, and a player for each stage",
    )
    parser.add(
        "exportprism",
        needs=Needs(not_with=(COMPARE, BATCH)),
        metavar="FILE",
        help="write the text of the model",
    )
    parser.add(
        "exportprismconst",
        needs=_MODEL,
        metavar="FILE",
        help="write the text of the model with the values of its constants",
    )
    parser.add(
        "exportprecision",
        "exportmodelprecision",
        needs=Needs((f"{_PARTS}|{_VECTORS}|-transient|-steadystate",)),
        metavar="N",
        type=digits,
        default=17,
        help="digits of written numbers (17: all)",
    )
    parser.add(
        "exportrows",
        needs=Needs(("-exportmodel|-exporttrans|-exporttransrewards|-exportrewards",)),
        action="store_true",
        help="write transitions with a line per row",
    )
    parser.add(
        "noexportheaders",
        needs=Needs((_PARTS,)),
        action="store_true",
        help="no comments at the top of exported files",
    )
    parser.add(
        "exportmatlab",
        needs=Needs((_PARTS,)),
        action="store_true",
        help="write matrices, rewards, states and labels for Matlab",
    )


def add_distributions(parser: SwitchParser) -> None:
    """The switches of transient and steady-state probabilities."""
    parser.add(
        "transient",
        "tr",
        needs=Needs(model=True),
        metavar="T",
        help="distribution over the states at a time (DTMC: a step), or at times low:step:high",
    )
    parser.add(
        "steadystate",
        "ss",
        needs=Needs(model=True),
        action="store_true",
        help="distribution over the states in the long run",
    )
    parser.add(
        "exporttransient",
        "exporttr",
        needs=Needs(("-transient",), not_with=(BATCH,), model=True),
        metavar="FILE",
        help="write the probabilities of -transient, a line per state",
    )
    parser.add(
        "exportsteadystate",
        "exportss",
        needs=Needs(("-steadystate",), not_with=(BATCH,), model=True),
        metavar="FILE",
        help="write the probabilities of -steadystate, a line per state",
    )


def add_output(parser: SwitchParser) -> None:
    """The switches of results, tests and information."""
    parser.add(
        "v",
        "verbose",
        dest="verbose",
        action="store_true",
        help="tell more: iterations, methods, diagrams",
    )
    parser.add(
        "exportresults",
        needs=Needs((PROPERTY,), not_with=("-nobuild", COMPARE, BATCH)),
        metavar="FILE[:KIND]",
        help="write the results: .csv .json .parquet, plots .png .svg .pdf; or by KIND text "
        "(default), csv, matrix, dataframe, comment, json ('stdout' for FILE prints)",
    )
    parser.add(
        "importresults",
        needs=Needs(not_with=(BATCH, COMPARE)),
        metavar="FILE",
        help="read results that -exportresults has written (.csv, .json, PRISM's data frame), and "
        "print them or write them with -exportresults; there is no model",
    )
    parser.add(
        "jobs",
        needs=Needs((f"{VALUES}|-sim",), not_with=("-step", "-scheduler", COMPARE), note=True),
        metavar="N",
        type=positive_count,
        default=1,
        help="check models with different constants in N processes at the same time, or sample the "
        "paths of -sim (default: 1)",
    )
    parser.add(
        "resume",
        needs=Needs(
            (PROPERTY,), not_with=("-sim", "-simpath", "-step", "-nobuild", COMPARE, BATCH)
        ),
        metavar="FILE",
        help="write finished results to FILE, and do not compute again those that it has",
    )
    parser.add(
        "scheduler",
        metavar="ADDRESS",
        help="do this on the workers of a Dask cluster; ADDRESS is that of its scheduler, such "
        "as tcp://host:8786",
    )
    parser.add(
        "distributed",
        needs=Needs(
            ("-scheduler", PROPERTY),
            not_with=("-sim", "-simpath", "-step", "-nobuild", "-exact", "-resume", COMPARE),
        ),
        action="store_true",
        help="partition the states of each model over the workers of -scheduler",
    )
    parser.add(
        "checkpoints",
        needs=Needs(("-distributed",), not_with=(BATCH,)),
        metavar="DIR",
        help="keep the parts of -distributed in a folder that all machines share, to go on from "
        "when a worker is lost or the run is started again",
    )
    parser.add(
        "exportstrat",
        needs=_RESULT,
        metavar="FILE[:type=KIND]",
        help="write a strategy of each mdp property: actions (default), indices, induced, dot; "
        "the induced chain also as FILE.tra,sta,lab or FILE.all",
    )
    parser.add(
        "exportvector",
        needs=_RESULT,
        metavar="FILE",
        action="append",
        default=[],
        help="write the value of each property in every state, a line per state; several switches "
        "write several files",
    )
    parser.add(
        "counterexample",
        needs=Needs((PROPERTY,), not_with=("-resume",), model=True),
        action="store_true",
        help="show why a bound P<=p [...], R<=r [F ...] or R<=r [C<=k] is false or true: likeliest "
        "paths, and few commands",
    )
    parser.add(
        "exportcounterexample",
        needs=_RESULT,
        metavar="FILE",
        help="write them: .txt, .json or .dot",
    )
    parser.add(
        "counterexamplepaths",
        needs=Needs(("-counterexample|-exportcounterexample",)),
        metavar="N",
        type=typed(read_count),
        help="the most paths of a counterexample (default: 1000)",
    )
    for part, what in (("trans", "transitions"), ("states", "states")):
        parser.add(
            f"exportprod{part}",
            needs=_RESULT,
            metavar="FILE",
            help=f"write the {what} of the product with the automaton of each LTL property",
        )
    parser.add(
        "exportpareto",
        needs=_RESULT,
        metavar="FILE",
        help="write the Pareto front of a multi(...) query: .csv (vertices) or .json (also its "
        "half-spaces); 'stdout' prints",
    )
    parser.add(
        "exportiterations",
        needs=Needs((PROPERTY,), ("-nobuild", "-sim", "-scheduler", "-resume", COMPARE, BATCH)),
        metavar="FILE",
        help="write each iteration of the numerical methods of a property: .csv or .json "
        "(-exportpage plays them)",
    )
    parser.add("nobuild", action="store_true", help="only read the model")
    parser.add(
        "test",
        needs=Needs((PROPERTY,), not_with=("-nobuild", "-resume", COMPARE)),
        action="store_true",
        help="compare with the RESULT lines; stop at the first that fails",
    )
    parser.add(
        "testall",
        needs=Needs((PROPERTY,), not_with=("-nobuild", "-resume", COMPARE)),
        action="store_true",
        help="compare with the RESULT lines; go on after a failure",
    )
    parser.add(
        "exporttests",
        needs=Needs(("-test|-testall",), not_with=(BATCH,)),
        metavar="FILE",
        help="write the outcome of -test or -testall: .xml (JUnit) or .json",
    )
    parser.add(
        "with",
        needs=Needs((PROPERTY,), not_with=("-nobuild",)),
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
    parser.add(
        "mainlog",
        needs=Needs(not_with=(BATCH,)),
        metavar="FILE",
        help="write the output to a file",
    )
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
