"""The switches of the input, of options, of simulation and of imports."""

from __future__ import annotations

from symcheck.cli.switches.needs import ALWAYS, COMPARE, NEEDS_OF_OPTIONS, PROPERTY, Needs
from symcheck.cli.switches.parser import (
    SetOption,
    SwitchParser,
    positive_count,
    positive_number,
    typed,
)
from symcheck.options import OPTIONS, read_count, read_fraction
from symcheck.syntax.ast import ModelType

__all__ = ["add_imports", "add_input", "add_options", "add_simulation"]

_SAMPLING = Needs(("-sim",))
_HERE = Needs(not_with=("-nobuild", "-scheduler", COMPARE))


def add_options(parser: SwitchParser, group: str) -> None:
    """The switches of the options of a group."""
    for option in OPTIONS:
        for switch in option.switches if option.group == group else ():
            takes_value = switch.value is None
            parser.add(
                *switch.names,
                dest=option.name,
                action=SetOption,
                value=switch.value,
                nargs=None if takes_value else 0,
                type=typed(option.values.read) if takes_value else None,
                metavar=option.values.metavar if takes_value else None,
                help=switch.help,
                needs=NEEDS_OF_OPTIONS.get(f"-{switch.names[0]}", ALWAYS),
            )


def add_input(parser: SwitchParser) -> None:
    """The files, and the switches of what is read from them."""
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
        needs=Needs((PROPERTY,)),
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
            help=f"read the model as {'an' if kind.has_choices else 'a'} {kind.name}",
        )


def add_simulation(parser: SwitchParser) -> None:
    """The switches of random paths."""
    parser.add(
        "simpath",
        needs=_HERE,
        metavar=("PATH", "FILE"),
        nargs=2,
        help="write a random path ('stdout' prints it). PATH: steps, time=T or deadlock, and "
        ",vars=(x,…) sep=comma|space|tab rewards= probs= changes= loopcheck= snapshot=T repeat=N",
    )
    parser.add(
        "step",
        needs=_HERE,
        action="store_true",
        help="step through the model: shows the state and its choices, reads which one to take",
    )
    parser.add(
        "sim",
        needs=Needs((PROPERTY,), not_with=("-nobuild", COMPARE)),
        action="store_true",
        help="estimate P and R properties from random paths; the model is not built",
    )
    parser.add(
        "simmethod",
        needs=_SAMPLING,
        metavar="NAME",
        default="ci",
        help="ci (default), aci, apmc: intervals; sprt: a test, for thresholds",
    )
    parser.add(
        "simsamples",
        needs=_SAMPLING,
        metavar="N",
        type=positive_count,
        help="number of paths (default: 1000, or what -simwidth needs)",
    )
    parser.add(
        "simconf",
        needs=_SAMPLING,
        metavar="X",
        type=typed(read_fraction),
        help="probability that interval or verdict are wrong (default: 0.01)",
    )
    parser.add(
        "simwidth",
        needs=_SAMPLING,
        metavar="W",
        type=positive_number,
        help="half the width of the interval; what sprt tells apart (default: 0.05)",
    )
    parser.add(
        "simapprox",
        needs=_SAMPLING,
        metavar="W",
        type=positive_number,
        help="the same, by the name that it has for apmc",
    )
    parser.add(
        "simvar",
        needs=Needs(("-sim", "-simwidth|-simapprox")),
        metavar="N",
        type=typed(read_count),
        default=1000,
        help="paths from which -simwidth judges the variance (default: 1000)",
    )
    parser.add(
        "simmaxrwd",
        needs=_SAMPLING,
        metavar="X",
        type=positive_number,
        help="the largest reward that a path can earn, if none is negative; apmc needs it",
    )
    parser.add(
        "simpathlen",
        needs=Needs(("-sim|-simpath",)),
        metavar="N",
        type=typed(read_count),
        default=10_000,
        help="the longest path (default: 10000)",
    )
    parser.add(
        "seed",
        "simseed",
        needs=Needs(("-sim|-simpath|-step",)),
        metavar="N",
        type=typed(read_count),
        help="seed of the random numbers (default: a new one, which is reported)",
    )


def add_imports(parser: SwitchParser) -> None:
    """The switches of models and distributions in explicit files."""
    parser.add(
        "importmodel",
        metavar="BASE.all",
        help="read the model from BASE.tra, .sta, .lab, .srew, .trew (or BASE.tra,sta,…), from a "
        "file .pexp, .drn or .umb; files .gz and .xz are compressed",
    )
    for name, what in (
        ("trans", "transitions (.tra)"),
        ("states", "states (.sta)"),
        ("labels", "labels (.lab)"),
        ("staterewards", "state rewards (.srew)"),
        ("transrewards", "transition rewards (.trew)"),
    ):
        parser.add(
            f"import{name}",
            metavar="FILE",
            help=f"read the {what} of a model",
            needs=ALWAYS if name == "trans" else Needs(("-importtrans",)),
        )
    parser.add(
        "importstrat",
        metavar="FILE",
        help="follow the strategy in FILE (as -exportstrat writes it): check, simulate and export "
        "the chain that it induces on an mdp",
    )
    parser.add(
        "importinitdist",
        needs=Needs(("-transient|-steadystate",)),
        metavar="FILE",
        help="initial distribution for -transient and -steadystate: a probability per line",
    )
