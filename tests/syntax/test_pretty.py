"""Whatever is printed reads back as the same tree."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peers_folder import PEERS, needs_peers
from symcheck.errors import SyntaxFault
from symcheck.syntax import ast
from symcheck.syntax import declarations as decl
from symcheck.syntax.ast import Binary, Expression, Literal, Name, PathFormula, Type
from symcheck.syntax.grammars import load
from symcheck.syntax.operators import Function, Operator, UnaryOperator
from symcheck.syntax.parse import parse_expression, parse_model, parse_properties
from symcheck.syntax.printer import pretty, pretty_number
from symcheck.syntax.tree_builder import FILTERS, LONGEST_CHAIN
from syntax.samples import MODEL, PROPERTIES

NAMES = st.sampled_from(["x", "y", "_z1", "Fx", "floor", "modx", "rew"])
INTEGERS = st.integers(0, 2**40)
DOUBLES = st.builds(
    lambda n, p: Fraction(n) * Fraction(10) ** p, st.integers(0, 10**6), st.integers(-30, 30)
)
LITERALS = st.one_of(
    st.booleans().map(lambda v: Literal(v, Type.BOOL)),
    INTEGERS.map(lambda v: Literal(v, Type.INT)),
    DOUBLES.map(lambda v: Literal(v, Type.DOUBLE)),
)
ATOMS = st.one_of(LITERALS, NAMES.map(Name))


def combined(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    """Expressions of a model over inner ones."""
    return st.one_of(
        st.builds(Binary, st.sampled_from(Operator), inner, inner),
        st.builds(ast.Unary, st.sampled_from(UnaryOperator), inner),
        st.builds(ast.Conditional, inner, inner, inner),
        st.builds(
            ast.Call, st.sampled_from(Function), st.lists(inner, min_size=1, max_size=3).map(tuple)
        ),
    )


EXPRESSIONS = st.recursive(ATOMS, combined, max_leaves=12)
PLAIN_TIMES = st.one_of(
    st.builds(lambda e, s: ast.TimeBound(upper=e, upper_strict=s), EXPRESSIONS, st.booleans()),
    st.builds(lambda e, s: ast.TimeBound(lower=e, lower_strict=s), EXPRESSIONS, st.booleans()),
    st.builds(lambda a, b: ast.TimeBound(lower=a, upper=b), EXPRESSIONS, EXPRESSIONS),
)
COUNTS = st.builds(
    lambda s, t: ast.RewardBound(t.lower, t.lower_strict, t.upper, t.upper_strict, s),
    st.one_of(st.none(), NAMES, LITERALS),
    PLAIN_TIMES,
)
TIMES = st.one_of(
    PLAIN_TIMES,
    COUNTS,
    st.builds(ast.RewardBounds, st.lists(COUNTS, min_size=2, max_size=3).map(tuple)),
)
BOUNDS = st.one_of(
    st.none(),
    st.builds(ast.Bound, st.sampled_from(["<", "<=", ">", ">="]).map(Operator), EXPRESSIONS),
)
DIRECTIONS = st.sampled_from([None, "min", "max", "minmax", "maxmin"])


def temporal(inner: st.SearchStrategy[PathFormula]) -> st.SearchStrategy[PathFormula]:
    bound = st.one_of(st.none(), TIMES)
    return st.one_of(
        *(st.builds(kind, inner, bound) for kind in (ast.Next, ast.Eventually, ast.Globally)),
        *(st.builds(kind, inner, inner, bound) for kind in (ast.Until, ast.WeakUntil, ast.Release)),
    )


def path_formulas(inner: st.SearchStrategy[PathFormula]) -> st.SearchStrategy[PathFormula]:
    return st.one_of(
        temporal(inner),
        st.builds(
            Binary, st.sampled_from(["&", "|", "=>", "<=>", "="]).map(Operator), inner, inner
        ),
        st.builds(ast.Unary, st.just(UnaryOperator.NOT), inner),
        st.builds(ast.Conditional, inner, inner, inner),
    )


def properties(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    """Properties over inner ones."""
    paths = st.recursive(inner, path_formulas, max_leaves=4)
    queries = st.one_of(
        paths,
        EXPRESSIONS.map(lambda e: ast.CumulativeReward(ast.TimeBound(upper=e))),
        EXPRESSIONS.map(ast.InstantaneousReward),
        st.just(ast.TotalReward()),
        st.just(ast.SteadyStateReward()),
        COUNTS.map(ast.CostBoundedReward),
        st.builds(
            ast.DiscountedReward,
            st.one_of(st.none(), EXPRESSIONS.map(lambda e: ast.TimeBound(upper=e))),
            EXPRESSIONS,
        ),
    )
    structures = st.one_of(st.none(), NAMES, EXPRESSIONS)
    operators = st.one_of(
        st.builds(ast.ProbabilityOperator, DIRECTIONS, BOUNDS, paths),
        st.builds(ast.RewardOperator, DIRECTIONS, BOUNDS, structures, queries),
        st.builds(ast.ConditionalProbability, DIRECTIONS, BOUNDS, temporal(paths), temporal(paths)),
        st.builds(ast.ExpectedTime, DIRECTIONS, BOUNDS, paths),
        st.builds(ast.SteadyState, DIRECTIONS, BOUNDS, inner),
    )
    return st.one_of(
        combined(inner),
        operators,
        st.builds(ast.PathQuantifier, st.sampled_from(["A", "E"]), paths),
        st.builds(ast.Filter, st.sampled_from(FILTERS), inner, st.one_of(st.none(), inner)),
        st.builds(
            ast.StateFilter,
            st.lists(st.sampled_from(["min", "max"]), max_size=2).map(tuple),
            operators,
            inner,
        ),
        st.builds(
            ast.Quantile,
            st.sampled_from(["min", "max"]),
            st.just("bound"),
            st.builds(
                ast.ProbabilityOperator,
                DIRECTIONS,
                BOUNDS.filter(lambda b: b is not None),
                st.builds(
                    ast.Eventually,
                    inner,
                    st.just(ast.TimeBound(upper=ast.Parameter(0, Type.INT, "bound"))),
                ),
            ),
        ),
        st.builds(ast.MultiObjective, st.lists(inner, min_size=1, max_size=3).map(tuple)),
    )


@given(EXPRESSIONS)
def test_expressions(tree: Expression) -> None:
    assert parse_expression(pretty(tree)) == tree
    label = parse_model(f'label "x" = {pretty(tree)};').labels[0]
    assert label.expression == tree  # both grammars read expressions alike


@pytest.mark.filterwarnings("ignore:Generating overly large repr")
@settings(deadline=None, max_examples=50)
@given(st.recursive(st.one_of(ATOMS, NAMES.map(ast.LabelReference)), properties, max_leaves=6))
def test_properties(tree: Expression) -> None:
    assert parse_expression(pretty(tree)) == tree


def variables(name: str) -> st.SearchStrategy[decl.VariableDeclaration]:
    initial = st.one_of(st.none(), EXPRESSIONS)
    return st.one_of(
        st.builds(
            decl.VariableDeclaration,
            st.just(name),
            st.just(Type.INT),
            EXPRESSIONS,
            EXPRESSIONS,
            initial,
        ),
        st.builds(
            decl.VariableDeclaration,
            st.just(name),
            st.sampled_from([Type.INT, Type.BOOL]),
            st.none(),
            st.none(),
            initial,
        ),
    )


UPDATES = st.lists(st.builds(decl.Assignment, NAMES, EXPRESSIONS), max_size=3).map(tuple)
COMMANDS = st.builds(
    decl.Command,
    st.one_of(st.none(), NAMES),
    EXPRESSIONS,
    st.one_of(
        UPDATES.map(lambda a: (decl.Update(None, a),)),
        st.lists(
            st.builds(decl.Update, EXPRESSIONS, UPDATES, st.none() | EXPRESSIONS),
            min_size=1,
            max_size=3,
        ).map(tuple),
    ),
)
ACTIONS = st.lists(NAMES, min_size=1, max_size=2).map(tuple)
COMPOSITIONS: st.SearchStrategy[decl.Composition] = st.recursive(
    NAMES.map(decl.ModuleReference),
    lambda inner: st.one_of(
        st.builds(decl.Parallel, st.lists(inner, min_size=2, max_size=3).map(tuple)),
        st.builds(decl.Interleaving, st.lists(inner, min_size=2, max_size=3).map(tuple)),
        st.builds(decl.Synchronised, inner, inner, ACTIONS),
        st.builds(decl.Hiding, inner, ACTIONS),
        st.builds(
            decl.Renaming,
            inner,
            st.lists(st.tuples(NAMES, NAMES), min_size=1, max_size=2).map(tuple),
        ),
    ),
    max_leaves=6,
)
ITEMS = st.builds(
    decl.RewardItem, st.one_of(st.just(False), st.none(), NAMES), EXPRESSIONS, EXPRESSIONS
)
PROGRAMS = st.builds(
    decl.Program,
    st.one_of(st.none(), st.sampled_from(ast.ModelType)),
    constants=st.lists(
        st.builds(decl.Constant, NAMES, st.sampled_from(Type), st.one_of(st.none(), EXPRESSIONS)),
        max_size=2,
    ).map(tuple),
    formulas=st.lists(st.builds(decl.Formula, NAMES, EXPRESSIONS), max_size=1).map(tuple),
    labels=st.lists(st.builds(decl.Label, NAMES, EXPRESSIONS), max_size=1).map(tuple),
    globals=st.lists(variables("g"), max_size=1).map(tuple),
    modules=st.lists(
        st.one_of(
            st.builds(
                decl.Module,
                NAMES,
                st.lists(variables("v"), max_size=2).map(tuple),
                st.lists(COMMANDS, max_size=2).map(tuple),
            ),
            st.builds(
                decl.RenamedModule,
                NAMES,
                NAMES,
                st.lists(st.tuples(NAMES, NAMES), min_size=1, max_size=2).map(tuple),
            ),
        ),
        max_size=2,
    ).map(tuple),
    rewards=st.lists(
        st.builds(
            decl.RewardStructure,
            st.one_of(st.none(), NAMES),
            st.lists(ITEMS, max_size=2).map(tuple),
        ),
        max_size=1,
    ).map(tuple),
    initial=st.one_of(st.none(), EXPRESSIONS),
    system=st.one_of(st.none(), COMPOSITIONS),
)


@settings(deadline=None, max_examples=60)
@given(PROGRAMS)
def test_programs(program: decl.Program) -> None:
    assert parse_model(pretty(program)) == program


@given(COMPOSITIONS)
def test_compositions(tree: decl.Composition) -> None:
    assert parse_model(f"system {pretty(tree)} endsystem").system == tree


def test_samples() -> None:
    program = parse_model(MODEL)
    assert parse_model(pretty(program)) == program
    file = parse_properties(PROPERTIES)
    assert parse_properties(pretty(file)) == file
    for item in file.properties:
        assert parse_properties(pretty(item)).properties == (item,)


@pytest.mark.parametrize("length", [LONGEST_CHAIN, LONGEST_CHAIN + 1, 500, 5000])
def test_long_chains(length: int) -> None:
    tree = parse_expression("|".join(f"x={i}" for i in range(length)))
    assert parse_expression(pretty(tree)) == tree
    leaning: Expression = Name("x")
    for _ in range(min(length, 300)):
        leaning = Binary(Operator.PLUS, leaning, Name("y"))
    assert parse_expression(pretty(leaning)) == leaning


@pytest.mark.parametrize(
    "number", ["0.0", "1.0", "0.5", "100.25", "0.0001", "1e-30", "1e30", "25e-31", "123456789.0"]
)
def test_numbers_keep_their_digits(number: str) -> None:
    assert pretty(parse_expression(number)) == number


def test_numbers_without_digits_become_quotients() -> None:
    assert pretty_number(Fraction(1, 3)) == "(1.0/3.0)"


RESERVED = "A C E F G I P Pmax Pmin R Rmax Rmin S U W X filter pta"
"""Words of properties and of other models, which a model cannot use as names either."""


def test_reserved_words_are_no_names() -> None:
    keywords = [word for word in load("prism").spelling.values() if word.isalpha()]
    for word in (*keywords, *RESERVED.split()):
        with pytest.raises(SyntaxFault):
            parse_model(f"const int {word} = 1;")


@needs_peers
def test_peers() -> None:
    # The other folders have models of other types, and faulty ones.
    folders = ("prism-tests", "prism-benchmarks", "qcomp")
    paths = [p for folder in folders for p in sorted((PEERS / folder).rglob("*"))]
    models = [p for p in paths if p.suffix in (".prism", ".nm", ".pm", ".sm")]
    files = [p for p in paths if p.suffix in (".props", ".pctl", ".csl")]
    assert len(models) > 200
    assert len(files) > 200
    for path in models:
        program = parse_model(path.read_text(), path.name)
        assert parse_model(pretty(program)) == program, path
    for path in files:
        file = parse_properties(path.read_text(), path.name)
        assert parse_properties(pretty(file)) == file, path
