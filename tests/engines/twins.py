"""Models of each type, built on both sides, and random sets of their states; shared by the tests of
the symbolic engines.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.symbolic.engine import SymbolicEngine
from symcheck.engines.symbolic.forms import HybridEngine, MtbddEngine, SparseEngine
from symcheck.engines.symbolic.sets import SymbolicSet
from symcheck.explicit.build import explore
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.symbolic.build import construct
from symcheck.syntax.parse import parse_model

MODELS = {
    "dtmc": """
dtmc
module walk
  x : [0..9];
  lost : bool;
  [] x>0 & x<9 & !lost -> 0.3:(x'=x-1) + 0.5:(x'=x+1) + 0.2:(lost'=true);
  [] lost & x>2 -> 1:(x'=x-1);
  [] x=9 -> 0.5:(x'=9) + 0.5:(x'=8);
endmodule
module other
  y : [0..3];
  [] y<3 & x<7 -> 0.5:(y'=y+1) + 0.5:true;
endmodule
init x>=3 & x<=5 & y<=1 & !lost endinit
rewards "cost" x>3 : x/4; [] y=1 : 2; endrewards
rewards y=3 : 1; endrewards
""",
    "ctmc": """
ctmc
module machine
  jobs : [0..5] init 0;
  up : bool init true;
  [arrive] jobs<5 -> 1.5:(jobs'=jobs+1);
  [serve] up & jobs>0 -> 2:(jobs'=jobs-1);
  [] up -> 0.1:(up'=false);
  [] !up & jobs<4 -> 0.7:(up'=true);
endmodule
module counter
  c : [0..2] init 0;
  [serve] c<2 -> (c'=c+1);
  [] c=2 -> 3:(c'=0);
endmodule
rewards "queue" true : jobs; [serve] true : 1; [arrive] jobs=4 : 5; endrewards
""",
    "mdp": """
mdp
module a
  s : [0..6] init 0;
  [go] s<3 -> 0.5:(s'=s+1) + 0.5:(s'=0);
  [stay] s=1 -> (s'=1);
  [stay] s=2 -> 0.9:(s'=1) + 0.1:(s'=4);
  [] s=1 -> (s'=4);
  [] s=4 -> 0.25:(s'=5) + 0.75:(s'=4);
  [swap] s=5 -> (s'=6);
  [swap] s=6 -> (s'=5);
endmodule
module b
  t : [0..2] init 0;
  [go] t<2 -> (t'=t+1);
  [go] t=2 -> 0.5:(t'=0) + 0.5:true;
  [] s>3 & t>0 -> (t'=t-1);
endmodule
rewards "steps" [go] true : 1; [] s=4 : 3; s=1 : 0.5; endrewards
""",
}
ENGINES = (SparseEngine, HybridEngine, MtbddEngine)


@cache
def explicit(name: str) -> ExplicitEngine:
    return ExplicitEngine(explore(bind(parse_model(MODELS[name])), Options()))


def fresh(name: str, kind: type[SymbolicEngine]) -> SymbolicEngine:
    return kind.of(construct(bind(parse_model(MODELS[name])), Options()))


@cache
def symbolic(name: str, kind: type[SymbolicEngine]) -> SymbolicEngine:
    return fresh(name, kind)


@dataclass(frozen=True)
class Pair:
    """The same set in both engines."""

    array: ArraySet
    diagram: SymbolicSet


def pairs(name: str, count: int, kind: type[SymbolicEngine] = SparseEngine) -> Iterator[Pair]:
    yield from pairs_of(symbolic(name, kind), count)


def pairs_of(engine: SymbolicEngine, count: int) -> Iterator[Pair]:
    rng = np.random.default_rng(7)
    for share in np.resize([0.1, 0.5, 0.8], count):
        members = rng.random(engine.states) < share
        yield Pair(ArraySet(members), engine.from_bools(members))
