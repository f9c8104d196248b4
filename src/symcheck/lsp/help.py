"""What the words and signs of models and properties mean: a sentence and an example for each.

Hovering shows them, and completions, in the order of the table: what is written often comes first.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

__all__ = ["FILTERS", "HELP", "OF_TERMINAL", "Help"]


class Help(NamedTuple):
    """A meaning, in one sentence, and an example that follows the grammar."""

    meaning: str
    example: str

    @property
    def markdown(self) -> str:
        """Both, in Markdown."""
        return f"{self.meaning}\n\n```prism\n{self.example}\n```"


def _module(kind: str, *lines: str) -> str:
    return "\n".join([kind, "module m", *(f"  {line}" for line in lines), "endmodule"])


_DTMC = Help(
    "A Markov chain in discrete time: the updates of a command have probabilities.",
    _module("dtmc", "x : bool;", "[] true -> 0.5 : (x'=true) + 0.5 : (x'=false);"),
)
_CTMC = Help(
    "A Markov chain in continuous time: the updates of a command have rates.",
    _module("ctmc", "x : [0..3];", "[] x<3 -> 2.5 : (x'=x+1);"),
)
_MDP = Help(
    "A Markov decision process: somebody chooses among the commands that are enabled.",
    _module("mdp", "x : [0..1];", "[a] x=0 -> (x'=1);", "[b] x=0 -> 0.5 : (x'=1) + 0.5 : true;"),
)
_SMG = Help(
    "A stochastic game: in each state, one of several players chooses a command.",
    "smg\nplayer one m, [a] endplayer\nplayer two [b] endplayer\nmodule m\n  x : [0..1];\n"
    "  [a] x=0 -> (x'=1);\n  [b] x=1 -> (x'=0);\nendmodule",
)

HELP: Mapping[str, Help] = {
    # ------------------------------------------------------------------------- types of models
    "dtmc": _DTMC,
    "ctmc": _CTMC,
    "mdp": _MDP,
    "ma": Help(
        "A Markov automaton: commands with [] take no time, those with <> have rates.",
        _module("ma", "x : [0..1];", "[a] x=0 -> (x'=1);", "<> x=1 -> 2.5 : (x'=0);"),
    ),
    "pta": Help(
        "A probabilistic timed automaton: clocks measure the time between commands.",
        _module("pta", "x : [0..1];", "c : clock;", "[] x=0 & c>=2 -> (x'=1) & (c'=0);"),
    ),
    "pomdp": Help(
        "A partially observable decision process: who chooses sees the observables only.",
        "pomdp\nobservables x endobservables\nmodule m\n  x : bool;\n  y : bool;\n"
        "  [a] true -> (x'=y);\nendmodule",
    ),
    "popta": Help(
        "A partially observable timed automaton: clocks, and observables only to choose by.",
        "popta\nobservables x endobservables\nmodule m\n  x : bool;\n  c : clock;\n"
        "  [a] c>=1 -> (x'=true);\nendmodule",
    ),
    "smg": _SMG,
    "csg": Help(
        "A concurrent game: in each state, all players pick an action at once.",
        "csg\nplayer one m endplayer\nplayer two n endplayer\nmodule m\n  x : [0..1];\n"
        "  [a,b] x=0 -> (x'=1);\n  [a,c] x=0 -> true;\nendmodule\n"
        "module n\n  [b] x=0 -> true;\n  [c] x=0 -> true;\nendmodule",
    ),
    "tptg": Help(
        "A timed game: several players, and clocks that measure time.",
        "tptg\nplayer one m endplayer\nmodule m\n  x : bool;\n  c : clock;\n"
        "  [a] c>=1 -> (x'=true);\nendmodule",
    ),
    "probabilistic": _DTMC._replace(meaning="Another word for dtmc: a chain in discrete time."),
    "stochastic": _CTMC._replace(meaning="Another word for ctmc: a chain in continuous time."),
    "nondeterministic": _MDP._replace(meaning="Another word for mdp: a decision process."),
    "tsg": _SMG._replace(meaning="Another word for smg: a stochastic game."),
    # ------------------------------------------------------------------------- parts of models
    "module": Help(
        "A part of the model with variables and commands of its own.",
        "module m\n  x : [0..3] init 0;\n  [step] x<3 -> (x'=x+1);\nendmodule",
    ),
    "const": Help(
        "A constant, which a check gives a value if the text does not.",
        "const int N = 3;\nconst double p;",
    ),
    "formula": Help("A name for an expression.", "formula busy = x>0 & y>0;"),
    "label": Help("A name for the states in which something holds.", 'label "full" = x=3;'),
    "rewards": Help(
        "Rewards of states (condition : value;) and of commands ([action] condition : value;).",
        'rewards "cost"\n  x>0 : 1.5;\n  [send] true : 1;\nendrewards',
    ),
    "global": Help("A variable that all modules may write.", "global turn : [1..2] init 1;"),
    "init": Help(
        "The initial value of a variable; init … endinit is a condition on initial states.",
        "x : [0..3] init 2;",
    ),
    "player": Help(
        "A player of a game, with the modules and actions among which it chooses.",
        "player one m, [send] endplayer",
    ),
    "observables": Help(
        "The variables that are seen in a partially observable model.",
        "observables x, y endobservables",
    ),
    "observable": Help(
        "An expression that is seen in a partially observable model.", 'observable "high" = x>2;'
    ),
    "system": Help(
        "How modules run together; without it, they share all their common actions.",
        "system (a |[send]| b) ||| c endsystem",
    ),
    "rate": Help("A constant of type double, such as a rate.", "rate mu = 2.5;"),
    "prob": Help("A constant of type double, such as a probability.", "prob p = 0.5;"),
    # ------------------------------------------------------------------- variables and commands
    "[": Help(
        "Begins a range, an action or an interval: the range of a variable has two ends.",
        "x : [0..3] init 0;",
    ),
    "bool": Help("The type of what is true or false.", "x : bool init false;"),
    "int": Help("The type of whole numbers.", "const int N = 3;"),
    "double": Help("The type of numbers with a decimal point.", "const double p = 0.5;"),
    "clock": Help(
        "The type of a variable of a timed automaton that grows with time.", "c : clock;"
    ),
    "invariant": Help(
        "The condition of a timed automaton under which time may pass.",
        "invariant c<=2 endinvariant",
    ),
    "->": Help("Stands between the guard of a command and its updates.", "[step] x<3 -> (x'=x+1);"),
    "'": Help("The value of a variable after the command.", "[step] x<3 -> (x'=x+1);"),
    "endmodule": Help("Ends a module.", "module m\n  x : bool;\nendmodule"),
    "endrewards": Help("Ends a reward structure.", "rewards true : 1; endrewards"),
    "endinit": Help("Ends the condition on initial states.", "init x>0 endinit"),
    "endsystem": Help("Ends the composition of modules.", "system a || b endsystem"),
    "endplayer": Help("Ends a player.", "player one m endplayer"),
    "endobservables": Help("Ends the observables.", "observables x endobservables"),
    "endinvariant": Help("Ends an invariant.", "invariant c<=2 endinvariant"),
    # ------------------------------------------------------------------------------ properties
    "P": Help(
        "The probability of the paths in brackets, or whether it meets a bound.",
        'P=? [ F<=20 "full" ]',
    ),
    "Pmax": Help(
        "The largest probability that a strategy reaches for these paths.", 'Pmax=? [ F "goal" ]'
    ),
    "Pmin": Help(
        "The smallest probability that a strategy leaves to these paths.", 'Pmin=? [ F "goal" ]'
    ),
    "R": Help(
        "The expected reward: until something (F a), up to k (C<=k), at k (I=k), or in total (C).",
        'R{"cost"}=? [ F x=3 ]',
    ),
    "Rmax": Help(
        "The largest expected reward of a strategy; a name comes before max.",
        'R{"cost"}max=? [ F x=3 ]',
    ),
    "Rmin": Help(
        "The smallest expected reward of a strategy; a name comes before min.",
        'R{"cost"}min=? [ F x=3 ]',
    ),
    "S": Help(
        "The long run: the share of time in which a condition holds, or R=? [ S ], a reward rate.",
        "S=? [ x=3 ]",
    ),
    "Smax": Help(
        "The largest share of time, in the long run, that a strategy reaches.", "Smax=? [ x=3 ]"
    ),
    "Smin": Help(
        "The smallest share of time, in the long run, that a strategy leaves.", "Smin=? [ x=3 ]"
    ),
    "T": Help("The expected time, or number of steps, until something holds.", "T=? [ F x=3 ]"),
    "Tmax": Help("The longest expected time that a strategy reaches.", "Tmax=? [ F x=3 ]"),
    "Tmin": Help("The shortest expected time that a strategy reaches.", "Tmin=? [ F x=3 ]"),
    "F": Help(
        "F a: a holds now or later; F<=k a: within k steps, or k units of time.",
        'P=? [ F<=20 "full" ]',
    ),
    "G": Help("G a: a holds now and always.", "P=? [ G<=20 x<3 ]"),
    "X": Help("X a: a holds in the next state.", "P=? [ X x=1 ]"),
    "U": Help("a U b: b holds now or later, and a until then.", "P=? [ x<2 U<=20 x=3 ]"),
    "W": Help("a W b: a holds until b does, or always.", "P=? [ x<2 W x=3 ]"),
    "C": Help("C<=k: the expected reward up to k; C: the whole reward.", 'R{"cost"}=? [ C<=10 ]'),
    "I": Help("I=k: the expected reward of the state at k.", 'R{"cost"}=? [ I=10 ]'),
    "A": Help("Whether all paths have a property.", "A [ G x<3 ]"),
    "E": Help("Whether there is a path with a property.", "E [ F x=3 ]"),
    "filter": Help(
        "One value from those of several states: all, or those of the third argument.",
        "filter(max, P=? [ F x=3 ], y=0)",
    ),
    "multi": Help(
        "Several objectives of an MDP at once; more than one =? gives a Pareto front.",
        "multi(Pmax=? [ F x=3 ], R<=5 [ C ])",
    ),
    "multilex": Help(
        "Several objectives of an MDP in their order: each is the best after those before it.",
        "multilex(Pmax=? [ F x=3 ], Rmin=? [ C ])",
    ),
    "quantile": Help(
        "The least or greatest value of a constant for which a property holds.",
        "quantile(min B, P>0.9 [ F<=B x=3 ])",
    ),
    # ------------------------------------------------------------------------------- expressions
    "true": Help("What always holds; as an update, nothing changes.", "[idle] true -> true;"),
    "false": Help("What never holds.", "x : bool init false;"),
    "min": Help(
        "The smallest of some numbers; also a direction of measures and a filter.", "min(x, y, 3)"
    ),
    "max": Help(
        "The largest of some numbers; also a direction of measures and a filter.", "max(x, y, 3)"
    ),
    "mod": Help("The remainder of a division of whole numbers.", "mod(x, 2)=0"),
    "floor": Help("The number rounded down.", "floor(x/2)"),
    "ceil": Help("The number rounded up.", "ceil(x/2)"),
    "round": Help("The number rounded to the nearest whole number.", "round(x/2)"),
    "pow": Help("The first number to the power of the second.", "pow(0.5, x)"),
    "log": Help("The logarithm of the first number to the base of the second.", "log(x, 2)"),
    "func": Help("An older form of functions.", "func(max, x, y)"),
    "&": Help("Both hold.", "x=0 & y=0"),
    "|": Help("One of them holds, or both.", "x=0 | y=0"),
    "!": Help("It does not hold.", "!(x=0)"),
    "=>": Help("The second holds if the first does.", "x=0 => y=0"),
    "<=>": Help("Both hold, or neither.", "x=0 <=> y=0"),
    "=": Help("Both are equal.", "x=3"),
    "!=": Help("Both differ.", "x!=3"),
    "<": Help("The first is less than the second.", "x<3"),
    "<=": Help("The first is at most the second.", "x<=3"),
    ">": Help("The first is greater than the second.", "x>3"),
    ">=": Help("The first is at least the second.", "x>=3"),
    "+": Help("The sum; between updates, their alternative.", "0.5*x + y"),
    "-": Help("The difference, or the negative number.", "x - 1"),
    "*": Help("The product.", "2*x"),
    "/": Help("The quotient, which is a double.", "x/2"),
    "^": Help("The first number to the power of the second.", "x^2"),
    "?": Help(
        "A choice: the value before the colon if the condition holds, else that behind it; "
        "=? asks for a value.",
        "x>0 ? x : 0",
    ),
    # ------------------------------------------------------------- intervals of probabilities
    **{
        letter + strategy + nature: Help(
            f"With intervals of probabilities: the strategy is for the {strategy}imum, nature for "
            f"the {nature}imum.",
            f"{letter}{strategy}{nature}=? [ F x=3 ]",
        )
        for letter in ("P", "R")
        for strategy in ("max", "min")
        for nature in ("max", "min")
    },
    **{
        strategy + nature: Help(
            f"With intervals of probabilities: the strategy is for the {strategy}imum, nature for "
            f"the {nature}imum.",
            f'R{{"cost"}}{strategy}{nature}=? [ F x=3 ]',
        )
        for strategy in ("max", "min")
        for nature in ("max", "min")
    },
}
"""By word or sign. `R` is the measure."""

OF_TERMINAL: Mapping[str, Help] = {
    "RELEASE": Help("a R b: b holds until a and b hold together, or always.", "P=? [ x=3 R y<2 ]"),
    "GIVEN": Help(
        "The probability of a path formula given another one, which is behind the sign.",
        "P=? [ F x=3 || F y=3 ]",
    ),
    "COALITION": Help(
        "The players of a game that cooperate; the others are against them.",
        "<<1>> Pmax=? [ F x=3 ]",
    ),
}
"""Where a sign has another meaning, or many spellings, by terminal. `R` is an operator of paths."""

FILTERS: Mapping[str, str] = {
    "min": "the smallest value",
    "max": "the largest value",
    "avg": "the mean value",
    "sum": "the sum of the values",
    "count": "the number of states in which it holds",
    "forall": "whether it holds in all states",
    "exists": "whether it holds in some state",
    "range": "the smallest and the largest value",
    "first": "the value of the first state",
    "state": "the value of the only state",
    "argmin": "the states with the smallest value",
    "argmax": "the states with the largest value",
    "print": "the values, which are printed",
    "printall": "the values, zeros too, which are printed",
}
"""The functions of filters."""
