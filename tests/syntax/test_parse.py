"""What texts mean: precedence, positions, properties files."""

from __future__ import annotations

import sys
from collections.abc import Callable
from fractions import Fraction

import pytest

from symcheck.errors import SyntaxFault
from symcheck.syntax import ast
from symcheck.syntax import declarations as decl
from symcheck.syntax.ast import Literal, Name, Type
from symcheck.syntax.operators import Operator
from symcheck.syntax.parse import parse_expression, parse_model, parse_properties
from symcheck.syntax.traversal import nodes
from symcheck.syntax.tree_builder import LONGEST_CHAIN
from syntax.samples import MODEL, PROPERTIES

# Each line: a text, and the same with the parentheses that the language puts in.
SAME = """
a | b & c                      : a | (b & c)
a & b | c                      : (a & b) | c
a => b => c                    : a => (b => c)
a <=> b => c                   : (a <=> b) => c
a => b <=> c                   : a => (b <=> c)
a | b <=> c & d                : (a | b) <=> (c & d)
!a & b                         : (!a) & b
!a = b                         : !(a = b)
!!a < b + 1 & c                : (!(!(a < (b + 1)))) & c
c | !a = b & d                 : c | ((!(a = b)) & d)
!(!a) = b                      : !((!a) = b)
a = (!b)                       : a = ((!b))
a => !b = c => d               : a => ((!(b = c)) => d)
a = b < c                      : a = (b < c)
a < b = c                      : (a < b) = c
a = b = c                      : (a = b) = c
a < b + 1                      : a < (b + 1)
a - b - c                      : (a - b) - c
a - b + c                      : (a - b) + c
a / b * c                      : (a / b) * c
a + b * c                      : a + (b * c)
-a * b                         : (-a) * b
-a ^ 2                         : (-a) ^ 2
a ^ b ^ c                      : (a ^ b) ^ c
a * b ^ c                      : a * (b ^ c)
2 ^ -1 * 3                     : (2 ^ (-1)) * 3
a ? b : c ? d : e              : a ? b : (c ? d : e)
a => b ? c | d : e & f         : (a => b) ? (c | d) : (e & f)
a - -b                         : a - (-b)
P=? [ F a & b ]                : P=? [ F (a & b) ]
P=? [ F a U G b ]              : P=? [ (F a) U (G b) ]
P=? [ F ("a" U "b") U "c" ]    : P=? [ (F ("a" U "b")) U "c" ]
P=? [ a & b U c | d ]          : P=? [ (a & b) U (c | d) ]
P=? [ X X a => b ]             : P=? [ X (X (a => b)) ]
P=? [ G F a ]                  : P=? [ G (F a) ]
P=? [ F a & F b | c ]          : P=? [ F (a & (F (b | c))) ]
P=? [ a | b & X c ]            : P=? [ a | (b & (X c)) ]
P=? [ a & X b U !F c ]         : P=? [ (a & (X b)) U (!(F c)) ]
P=? [ !F a & b ]               : P=? [ !(F (a & b)) ]
P=? [ G a => !!F<=3 b ]        : P=? [ G (a => (!(!(F<=3 b)))) ]
P=? [ a ? b : c U d ]          : P=? [ (a ? b : c) U d ]
P=? [ F<=T (a) ]               : P=? [ F<=(T) a ]
P=? [ F<=2*T+1 a ]             : P=? [ F<=(2*T+1) a ]
P=? [ F=7 s=6 ]                : P=? [ F=7 (s=6) ]
P=? [ F<5 !a ]                 : P=? [ F<5 (!a) ]
E [ a R<3 b ]                  : E [ a R<3 (b) ]
P=? [ F a ] + 1                : (P=? [ F a ]) + 1
1 - P=? [ F a ] * 2            : 1 - ((P=? [ F a ]) * 2)
P>=1-p [ F a ] & "l"           : (P>=(1-p) [ F a ]) & "l"
P max =? [ F a ]               : Pmax=? [ F a ]
R min=? [ F a ]                : Rmin=? [ F a ]
func(max, a, b)                : max(a, b)
filter(&, a)                   : filter(forall, a)
filter(|, a, b)                : filter(exists, a, b)
filter(+, a)                   : filter(sum, a)
"a"                            : " a "
mod(a, 2)                      : mod( a,2 )
P>0.5[a]|P<0.1[b]              : (P>0.5 [ a ]) | (P<0.1 [ b ])
x < -1                         : x < (-1)
"""


@pytest.mark.parametrize(
    "line", SAME.strip().splitlines(), ids=lambda line: line.partition("  ")[0]
)
def test_precedence(line: str) -> None:
    text, _, full = line.partition("  : ")
    text, full = (
        (text.rstrip(), full) if full else tuple(part.strip() for part in line.split("  :", 1))
    )
    assert parse_expression(text) == parse_expression(full)


OUTSIDE = [
    "a U b",
    "P=? [ a U b U c ]",
    "P=? [ -F b ]",
    "P=? [ a ? F b : c ]",
    "S=? [ F a ]",
    "x = !y",
    "f(x)",
    "R=? [ C>=3 ]",
]


@pytest.mark.parametrize("text", OUTSIDE)
def test_not_in_the_language(text: str) -> None:
    with pytest.raises(SyntaxFault):
        parse_expression(text)


@pytest.mark.parametrize(
    ("text", "value", "kind"),
    [
        ("0", 0, Type.INT),
        ("1234567890123", 1234567890123, Type.INT),
        ("1.0", Fraction(1), Type.DOUBLE),
        (".5", Fraction(1, 2), Type.DOUBLE),
        ("0.1", Fraction(1, 10), Type.DOUBLE),
        ("1e-5", Fraction(1, 10**5), Type.DOUBLE),
        ("2.5E+3", Fraction(2500), Type.DOUBLE),
        ("1e-400", Fraction(1, 10**400), Type.DOUBLE),
        ("0e999999999", Fraction(0), Type.DOUBLE),
        ("007", Fraction(7), Type.DOUBLE),
        ("true", True, Type.BOOL),
        ("false", False, Type.BOOL),
    ],
)
def test_literals(text: str, value: object, kind: Type) -> None:
    literal = parse_expression(text)
    assert literal == Literal(value, kind)  # type: ignore[arg-type]
    assert isinstance(literal, Literal)
    assert type(literal.value) is type(value)


def test_bounds() -> None:
    def bound(text: str) -> object:
        operator = parse_expression(f"P=? [ F{text} a ]")
        assert isinstance(operator, ast.ProbabilityOperator)
        assert isinstance(operator.path, ast.Eventually)
        return operator.path.bound

    one, two = Literal(1, Type.INT), Literal(2, Type.INT)
    assert bound("<=1") == ast.TimeBound(upper=one)
    assert bound("<1") == ast.TimeBound(upper=one, upper_strict=True)
    assert bound(">=1") == ast.TimeBound(lower=one)
    assert bound(">1") == ast.TimeBound(lower=one, lower_strict=True)
    assert bound("=1") == ast.TimeBound(lower=one, upper=one)
    assert bound("[1,2]") == ast.TimeBound(lower=one, upper=two)
    less = ast.RewardBound(structure="t", upper=one, upper_strict=True)
    assert bound('^{rew{"t"}<1}') == bound('{"t"}<1') == less
    assert bound('^{rew{"t"}[1,2]}') == ast.RewardBound(structure="t", lower=one, upper=two)
    assert bound('^{rew{"t"}<1, rew{2}>=1, steps=1}') == ast.RewardBounds(
        (less, ast.RewardBound(structure=two, lower=one), ast.RewardBound(lower=one, upper=one))
    )
    assert bound("") is None


def test_model() -> None:
    program = parse_model(MODEL)
    assert program.type is ast.ModelType.CTMC
    assert [(c.name, c.type) for c in program.constants] == [
        *[("N", Type.INT), ("rate1", Type.DOUBLE)],
        *[("K", Type.INT), ("lambda", Type.DOUBLE)],
    ]
    first, second, third = program.modules
    assert isinstance(first, decl.Module)
    assert isinstance(second, decl.RenamedModule)
    assert isinstance(third, decl.RenamedModule)
    assert [v.type for v in first.variables] == [Type.INT, Type.BOOL, Type.INT]
    assert [c.action for c in first.commands] == [None, "go", "stop"]
    assert [len(u.assignments) for u in first.commands[0].updates] == [2, 0]
    assert first.commands[1].updates[0].probability is None
    assert third.renaming[-1] == ("min", "max")
    assert [r.name for r in program.rewards] == ["time", None]
    assert [item.action for item in program.rewards[0].items] == [False, "go", None]
    assert program.initial == parse_expression("a=0 <=> !done")


def test_composition() -> None:
    def a(name: str) -> decl.ModuleReference:
        return decl.ModuleReference(name)

    def system(text: str) -> object:
        return parse_model(f"system {text} endsystem").system

    assert system("a || b ||| c || d") == decl.Parallel(
        (a("a"), decl.Interleaving((a("b"), a("c"))), a("d"))
    )
    assert system("a |[x]| b ||| c") == decl.Interleaving(
        (decl.Synchronised(a("a"), a("b"), ("x",)), a("c"))
    )
    assert system("a |[x]| b |[y,z]| c") == decl.Synchronised(
        decl.Synchronised(a("a"), a("b"), ("x",)), a("c"), ("y", "z")
    )
    assert system("a || b / {x,y}") == decl.Parallel((a("a"), decl.Hiding(a("b"), ("x", "y"))))
    assert system("(a || b) {x<-y} / {y}") == decl.Hiding(
        decl.Renaming(decl.Parallel((a("a"), a("b"))), (("x", "y"),)), ("y",)
    )


@pytest.mark.parametrize("text", ["x<-1", "x < -1", "x< - 1"])
def test_less_than_a_negative_number(text: str) -> None:
    expected = parse_expression("x<(-1)")
    assert parse_expression(text) == expected
    assert parse_model(f'label "l" = {text};').labels[0].expression == expected


@pytest.mark.parametrize(
    "word", ["dtmc", "probabilistic", "ctmc", "stochastic", "mdp", "nondeterministic", ""]
)
def test_model_types(word: str) -> None:
    expected = {"p": "dtmc", "s": "ctmc", "n": "mdp"}.get(word[:1], word)
    kind = parse_model(word).type
    assert (kind.value if kind else "") == expected


def test_positions() -> None:
    program = parse_model(MODEL)
    first = program.modules[0]
    assert isinstance(first, decl.Module)
    assert first.span.text.startswith("module first")
    assert first.span.text.endswith("endmodule")
    command = first.commands[0]
    assert (
        command.span.text == "[] a<N & busy -> rate1 : (a'=a+1) & (done'=true) + lambda*2 : true;"
    )
    assert command.guard.span.text == "a<N & busy"
    assert [u.span.text for u in command.updates] == [
        "rate1 : (a'=a+1) & (done'=true)",
        "lambda*2 : true",
    ]
    assert command.updates[0].assignments[1].span.text == "(done'=true)"
    assert str(first.variables[1].span) == "<model>:14:3"
    assert program.labels[0].span.text.startswith('label "end"')


def test_positions_within_parentheses() -> None:
    tree = parse_expression("(a + (b)) * ((c) - d)")
    texts = [node.span.text for node in nodes(tree)]
    assert texts == ["(a + (b)) * ((c) - d)", "a + (b)", "a", "b", "(c) - d", "c", "d"]


def test_properties() -> None:
    file = parse_properties(PROPERTIES)
    assert [c.name for c in file.constants] == ["T"]
    assert [f.name for f in file.formulas] == ["f"]
    assert [label.name for label in file.labels] == ["safe"]
    assert [p.name for p in file.properties] == ["named"] + [None] * 14
    assert [p.span.text.split(" ")[0] for p in file.properties[1:4]] == [
        "P>=0.5",
        'R{"time"}max=?',
        "Rmin=?",
    ]
    old = file.properties[4].formula
    assert isinstance(old, ast.StateFilter)
    assert old.operators == ("min", "max")
    # Also where a brace behind C could begin a bound on a reward.
    assert all(isinstance(p.formula, ast.StateFilter) for p in file.properties[5:8])


def test_properties_need_no_semicolons() -> None:
    file = parse_properties('x=1 "a" P=? [ F b ] R{"c"}=? [ S ] 3 (y) ;; "n": z E [ X a ]')
    texts = [p.span.text for p in file.properties]
    assert texts == [
        "x=1",
        '"a"',
        "P=? [ F b ]",
        'R{"c"}=? [ S ]',
        "3",
        "(y)",
        '"n": z',
        "E [ X a ]",
    ]
    assert len(parse_properties("a\n-b").properties) == 1  # the longest match, as in PRISM


def test_comments_above_a_property() -> None:
    file = parse_properties(
        "// far away\n\n// RESULT: 1\n  //RESULT (x=1): 2\nP=? [ F a ]; // RESULT: 3\n"
        '"b": x\n// at the end\n\n// one\n\ny; z'
    )
    assert [p.comments for p in file.properties] == [
        ("RESULT: 1", "RESULT (x=1): 2"),
        ("RESULT: 3",),
        (),
        (),
    ]


@pytest.mark.parametrize("operator", ["&", "|", "+", "*"])
@pytest.mark.parametrize(
    "length", [LONGEST_CHAIN - 1, LONGEST_CHAIN, LONGEST_CHAIN + 1, LONGEST_CHAIN + 2, 1000, 20_000]
)
def test_long_chains_are_balanced(operator: str, length: int) -> None:
    tree = parse_expression(f" {operator} ".join(f"x{i}" for i in range(length)))
    leaves = [node.name for node in nodes(tree) if isinstance(node, Name)]
    assert leaves == [f"x{i}" for i in range(length)]
    depth, level = 0, [tree]
    while level:
        level = [
            child
            for node in level
            if isinstance(node, ast.Binary)
            for child in (node.left, node.right)
        ]
        depth += 1
    assert depth <= LONGEST_CHAIN + 30
    assert tree.span.text.endswith(f"x{length - 1}")
    assert tree.span.start == 0


def test_a_chain_is_broken_by_another_operator() -> None:
    tree = parse_expression("a + b - c + d + e")
    assert tree == parse_expression("(((a + b) - c) + d) + e")


def calls(text: str, parse: Callable[[str], object] = parse_expression) -> int:
    """The number of function calls that parsing a text takes, whether it has faults or not."""
    count = 0

    def counting(*_: object) -> None:
        nonlocal count
        count += 1

    sys.setprofile(counting)
    try:
        parse(text)
    except SyntaxFault:
        pass
    finally:
        sys.setprofile(None)
    return count


@pytest.mark.parametrize(
    ("opening", "closing"),
    [
        ("1+", "1"),
        ("x & ", "y"),
        ("(1+", "1"),
        ("P=? [ F ", "x"),
        ("a=>", "b"),
        ("1-", ""),
        ("x&&", "x"),
    ],
)
def test_work_grows_linearly(opening: str, closing: str) -> None:
    """Also with faults: brackets that nothing closes, and operators without an operand."""
    calls(closing)
    short, long = (calls(opening * n + closing) for n in (1000, 2000))
    assert long < 2.1 * short


def large_model(commands: int = 500, *, guard: str = "x<3") -> str:
    lines = (f"  [] x={i} & {guard} -> 0.5:(x'={i + 1}) + 0.5:(x'=0);" for i in range(commands))
    return "\n".join(("dtmc", "module m", "  x:[0..9999];", *lines, "endmodule", ""))


@pytest.mark.parametrize(
    "faulty",
    [
        lambda text: text.replace("dtmc", "dtmc hole p;"),
        lambda text: text.replace("dtmc", "evolve"),
        lambda text: text.replace("x=200 ", "x==700 "),
        lambda text: text.replace("[] x=200", "hole 3; [] x=200"),
        lambda text: text.replace("endmodule", "endmodul"),
        lambda text: text + "hole p;",
        lambda text: text.replace("\n", " ") + "hole p;",
        lambda text: text.replace("\n", " ").replace("dtmc", "dtmc hole"),
        lambda text: text.replace(";", ""),
    ],
    ids=range(9),
)
def test_a_large_text_with_a_fault_is_read_once(faulty: Callable[[str], str]) -> None:
    text = large_model()
    with pytest.raises(SyntaxFault):
        parse_model(faulty(text))  # also imports what describes faults
    assert calls(faulty(text), parse_model) < 1.1 * calls(text, parse_model)


def test_a_fault_behind_a_long_guard_does_not_have_the_guard_read_again() -> None:
    guard = " | ".join(f"x={i}" for i in range(2000))
    text = large_model(1, guard=guard)
    faulty = text.replace("->", "hole ->")
    with pytest.raises(SyntaxFault, match=r"unexpected 'hole'; expected an operator or '->'"):
        parse_model(faulty)
    assert calls(faulty, parse_model) < 1.1 * calls(text, parse_model)


def test_short_chains_lean_to_the_left() -> None:
    tree = parse_expression("a + b + c")
    assert tree == ast.Binary(
        Operator.PLUS, ast.Binary(Operator.PLUS, Name("a"), Name("b")), Name("c")
    )
