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
        "FILES[:OPTIONS]",
        "write the model: out.tra,sta,lab,srew,trew; out.all; out.pexp; out.dot; "
        "out.drn; out.umb; out.umbt; out.jani; "
        "'stdout' for out prints. "
        "OPTIONS: actions, headers, rows, states, proplabels (=false), precision=N",
        _MODEL,
        action=ExportPart,
        kinds="model",
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
            f"export{name}", "FILE", f"write the {what}", _MODEL, action=ExportPart, kinds=kind
        )
    parser.add(
        "exportrewards",
        "FILE",
        "write state and transition rewards",
        _MODEL,
        nargs=2,
        action=ExportPart,
        kinds="srew trew",
    )
    parser.add(
        "exportproplabels",
        "FILE",
        "write the labels of the properties (without FILE: with the labels of the model)",
        _MODEL,
        nargs="?",
        const="",
        action=ExportPart,
        kinds="proplab",
    )
    parser.add(
        "exportdot",
        "FILE",
        "write the matrix as a decision diagram, in DOT (default engine: -h)",
        _MODEL,
    )
    parser.add(
        "exportpage",
        "FILE",
        "write an HTML page: state graph, values, simulator, and a player for each stage",
        _MODEL,
    )
    parser.add(
        "exportprism", "FILE", "write the text of the model", Needs(not_with=(COMPARE, BATCH))
    )
    parser.add(
        "exportprismconst",
        "FILE",
        "write the text of the model with the values of its constants",
        _MODEL,
    )
    parser.add(
        "exportprecision exportmodelprecision",
        "N",
        "digits of written numbers (17: all)",
        Needs((f"{_PARTS}|{_VECTORS}|-transient|-steadystate",)),
        type=digits,
        default=17,
    )
    parser.add(
        "exportrows",
        "",
        "write transitions with a line per row",
        Needs(("-exportmodel|-exporttrans|-exporttransrewards|-exportrewards",)),
    )
    parser.add("noexportheaders", "", "no comments at the top of exported files", Needs((_PARTS,)))
    parser.add(
        "exportmatlab",
        "",
        "write matrices, rewards, states and labels for Matlab",
        Needs((_PARTS,)),
    )


def add_distributions(parser: SwitchParser) -> None:
    """The switches of transient and steady-state probabilities."""
    parser.add(
        "transient tr",
        "T",
        "distribution over the states at a time (DTMC: a step), or at times low:step:high",
        Needs(model=True),
    )
    parser.add(
        "steadystate ss", "", "distribution over the states in the long run", Needs(model=True)
    )
    parser.add(
        "exporttransient exporttr",
        "FILE",
        "write the probabilities of -transient, a line per state",
        Needs(("-transient",), not_with=(BATCH,), model=True),
    )
    parser.add(
        "exportsteadystate exportss",
        "FILE",
        "write the probabilities of -steadystate, a line per state",
        Needs(("-steadystate",), not_with=(BATCH,), model=True),
    )


def add_output(parser: SwitchParser) -> None:
    """The switches of results, tests and information."""
    parser.add("v verbose", "", "tell more: iterations, methods, diagrams", dest="verbose")
    parser.add(
        "exportresults",
        "FILE[:KIND]",
        "write the results: .csv .json .parquet, plots .png .svg .pdf; or by KIND text "
        "(default), csv, matrix, dataframe, comment, json ('stdout' for FILE prints)",
        Needs((PROPERTY,), not_with=("-nobuild", COMPARE, BATCH)),
    )
    parser.add(
        "importresults",
        "FILE",
        "read results that -exportresults has written (.csv, .json, PRISM's data frame), and "
        "print them or write them with -exportresults; there is no model",
        Needs(not_with=(BATCH, COMPARE)),
    )
    parser.add(
        "jobs",
        "N",
        "check models with different constants in N processes at the same time, or sample the "
        "paths of -sim (default: 1)",
        Needs((f"{VALUES}|-sim",), not_with=("-step", "-scheduler", COMPARE), note=True),
        type=positive_count,
        default=1,
    )
    parser.add(
        "resume",
        "FILE",
        "write finished results to FILE, and do not compute again those that it has",
        Needs((PROPERTY,), not_with=("-sim", "-simpath", "-step", "-nobuild", COMPARE, BATCH)),
    )
    parser.add(
        "scheduler",
        "ADDRESS",
        "do this on the workers of a Dask cluster; ADDRESS is that of its scheduler, such "
        "as tcp://host:8786",
    )
    parser.add(
        "distributed",
        "",
        "partition the states of each model over the workers of -scheduler",
        Needs(
            ("-scheduler", PROPERTY),
            not_with=("-sim", "-simpath", "-step", "-nobuild", "-exact", "-resume", COMPARE),
        ),
    )
    parser.add(
        "checkpoints",
        "DIR",
        "keep the parts of -distributed in a folder that all machines share, to go on from "
        "when a worker is lost or the run is started again",
        Needs(("-distributed",), not_with=(BATCH,)),
    )
    parser.add(
        "exportstrat",
        "FILE[:type=KIND]",
        "write a strategy of each mdp property: actions (default), indices, induced, dot; "
        "the induced chain also as FILE.tra,sta,lab or FILE.all",
        _RESULT,
    )
    parser.add(
        "exportvector",
        "FILE",
        "write the value of each property in every state, a line per state; several switches "
        "write several files",
        _RESULT,
        action="append",
        default=[],
    )
    parser.add(
        "counterexample",
        "",
        "show why a bound P<=p [...], R<=r [F ...] or R<=r [C<=k] is false or true: likeliest "
        "paths, and few commands",
        Needs((PROPERTY,), not_with=("-resume",), model=True),
    )
    parser.add("exportcounterexample", "FILE", "write them: .txt, .json or .dot", _RESULT)
    parser.add(
        "counterexamplepaths",
        "N",
        "the most paths of a counterexample (default: 1000)",
        Needs(("-counterexample|-exportcounterexample",)),
        type=typed(read_count),
    )
    for part, what in (("trans", "transitions"), ("states", "states")):
        parser.add(
            f"exportprod{part}",
            "FILE",
            f"write the {what} of the product with the automaton of each LTL property",
            _RESULT,
        )
    parser.add(
        "exportpareto",
        "FILE",
        "write the Pareto front of a multi(...) query: .csv (vertices) or .json (also its "
        "half-spaces); 'stdout' prints",
        _RESULT,
    )
    parser.add(
        "exportregions",
        "FILE",
        "write the regions of -param in which a property has each value: .csv or .json (boxes), "
        ".png .svg .pdf (drawn, of one or two parameters); 'stdout' prints",
        _RESULT._replace(all_of=("-param", PROPERTY)),
    )
    parser.add(
        "exportcertificate",
        "FILE.json",
        "write a certificate of the value, for symcheck-verify, and the model that it is about",
        _RESULT,
    )
    parser.add(
        "exportiterations",
        "FILE",
        "write each iteration of the numerical methods of a property: .csv or .json "
        "(-exportpage plays them)",
        Needs((PROPERTY,), ("-nobuild", "-sim", "-scheduler", "-resume", COMPARE, BATCH)),
    )
    parser.add("nobuild", "", "only read the model")
    parser.add(
        "test",
        "",
        "compare with the RESULT lines; stop at the first that fails",
        Needs((PROPERTY,), not_with=("-nobuild", "-resume", COMPARE)),
    )
    parser.add(
        "testall",
        "",
        "compare with the RESULT lines; go on after a failure",
        Needs((PROPERTY,), not_with=("-nobuild", "-resume", COMPARE)),
    )
    parser.add(
        "exporttests",
        "FILE",
        "write the outcome of -test or -testall: .xml (JUnit) or .json",
        Needs(("-test|-testall",), not_with=(BATCH,)),
    )
    parser.add(
        "with",
        "PEER",
        "symcheck compare MODEL PROPERTIES -with PEER: compare the answers with those of "
        "storm or prism, if it is installed ('prism -s' gives it switches)",
        Needs((PROPERTY,), not_with=("-nobuild",)),
        dest="peer",
    )
    parser.add(
        "batch",
        "FILE",
        "run each line of FILE (MODEL PROPERTIES switches) as if alone, in a process that has "
        "started already; - reads the lines from the standard input",
    )
    parser.add("mainlog", "FILE", "write the output to a file", Needs(not_with=(BATCH,)))
    parser.add("help ?", "SWITCH", "this text, or what a switch does", nargs="?", const="")
    parser.add(
        "completion", "SHELL", "print a script that completes switches in a shell: bash, zsh, fish"
    )
    parser.add("version", "", "the version")
    parser.add("javaversion", "", "the version of Python: there is no Java")
