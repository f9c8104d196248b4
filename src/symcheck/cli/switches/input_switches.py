"""The switches of the input, of options, of simulation and of imports."""

from __future__ import annotations

import argparse

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
                " ".join(switch.names),
                option.values.metavar if takes_value else "",
                switch.help,
                NEEDS_OF_OPTIONS.get(f"-{switch.names[0]}", ALWAYS),
                dest=option.name,
                action=SetOption,
                default=argparse.SUPPRESS,
                const=switch.value,
                nargs=None if takes_value else 0,
                type=typed(option.values.read) if takes_value else None,
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
    parser.add("pf pctl csl", "TEXT", "properties given as text", action="append", default=[])
    parser.add(
        "prop property",
        "N,N-N,NAME",
        "only these properties, by number (from 1), range of numbers or name",
        Needs((PROPERTY,)),
    )
    parser.add(
        "const",
        "X=V,…",
        "constants: values, lists {a,b}, ranges low:high or low:step:high",
        action="append",
        default=[],
    )
    parser.add(
        "param",
        "X=LOW:HIGH,…",
        "parameters: constants that are left open, with open ranges (default: 0:1)",
        action="append",
        default=[],
    )
    for kind in (k for k in ModelType if not k.has_own_syntax):
        parser.add(
            kind.value,
            "",
            f"read the model as {'an' if kind.has_choices else 'a'} {kind.name}",
            dest="model_type",
            action="store_const",
            const=kind,
        )


def add_simulation(parser: SwitchParser) -> None:
    """The switches of random paths."""
    parser.add(
        "simpath",
        "PATH FILE",
        "write a random path ('stdout' prints it). PATH: steps, time=T or deadlock, and "
        ",vars=(x,…) sep=comma|space|tab rewards= probs= changes= loopcheck= snapshot=T repeat=N",
        _HERE,
        nargs=2,
    )
    parser.add(
        "step",
        "",
        "step through the model: shows the state and its choices, reads which one to take",
        _HERE,
    )
    parser.add(
        "sim",
        "",
        "estimate P and R properties from random paths; the model is not built",
        Needs((PROPERTY,), not_with=("-nobuild", COMPARE)),
    )
    parser.add(
        "simmethod",
        "NAME",
        "ci (default), aci, apmc: intervals; sprt: a test, for thresholds",
        _SAMPLING,
        default="ci",
    )
    parser.add(
        "simsamples",
        "N",
        "number of paths (default: 1000, or what -simwidth needs)",
        _SAMPLING,
        type=positive_count,
    )
    parser.add(
        "simconf",
        "X",
        "probability that interval or verdict are wrong (default: 0.01)",
        _SAMPLING,
        type=typed(read_fraction),
    )
    parser.add(
        "simwidth",
        "W",
        "half the width of the interval; what sprt tells apart (default: 0.05)",
        _SAMPLING,
        type=positive_number,
    )
    parser.add(
        "simapprox",
        "W",
        "the same, by the name that it has for apmc",
        _SAMPLING,
        type=positive_number,
    )
    parser.add(
        "simvar",
        "N",
        "paths from which -simwidth judges the variance (default: 1000)",
        Needs(("-sim", "-simwidth|-simapprox")),
        type=typed(read_count),
        default=1000,
    )
    parser.add(
        "simmaxrwd",
        "X",
        "the largest reward that a path can earn, if none is negative; apmc needs it",
        _SAMPLING,
        type=positive_number,
    )
    parser.add(
        "simpathlen",
        "N",
        "the longest path (default: 10000)",
        Needs(("-sim|-simpath",)),
        type=typed(read_count),
        default=10_000,
    )
    parser.add(
        "seed simseed",
        "N",
        "seed of the random numbers (default: a new one, which is reported)",
        Needs(("-sim|-simpath|-step",)),
        type=typed(read_count),
    )


def add_imports(parser: SwitchParser) -> None:
    """The switches of models and distributions in explicit files."""
    parser.add(
        "importmodel",
        "BASE.all",
        "read the model from BASE.tra, .sta, .lab, .srew, .trew (or BASE.tra,sta,…), from a "
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
            "FILE",
            f"read the {what} of a model",
            ALWAYS if name == "trans" else Needs(("-importtrans",)),
        )
    parser.add(
        "importstrat",
        "FILE",
        "follow the strategy in FILE (as -exportstrat writes it): check, simulate and export "
        "the chain that it induces on an mdp",
    )
    parser.add(
        "importinitdist",
        "FILE",
        "initial distribution for -transient and -steadystate: a probability per line",
        Needs(("-transient|-steadystate",)),
    )
