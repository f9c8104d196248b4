from __future__ import annotations

import sys
from pathlib import Path
from random import Random

import pytest

from automata.words import holds, made, random_tree, random_word
from symcheck.automata.external import SYNTAXES, format_formula, translate_externally
from symcheck.automata.ltl import LtlFactory
from symcheck.errors import InputError, UnsupportedError, UsageError


def _parsed(words: list[str]):
    """A tree from the words of prefix notation, which are used up."""
    word = words.pop(0)
    if word in ("t", "f"):
        either = ("p", 0), ("!", ("p", 0))
        return ("|" if word == "t" else "&", *either)
    if word[0] == "p":
        return ("p", int(word[1:]))
    if word in "!XFG":
        return (word, _parsed(words))
    return ({"V": "R"}.get(word, word), _parsed(words), _parsed(words))


def test_prefix_notation_says_the_formula():
    random = Random(11)
    for _ in range(100):
        tree = random_tree(random, 2, random.randint(1, 8))
        words = format_formula(made(LtlFactory(), tree)).split()
        back = _parsed(words)
        assert not words
        for _ in range(15):
            word = random_word(random, 4)
            assert holds(back, *word) == holds(tree, *word)


def test_infix_notations():
    f = LtlFactory()
    a, b = f.literal(0), f.literal(1)
    formula = f.conjunction(
        (
            f.always(f.negation(a)),
            f.disjunction((f.always(f.eventually(b)), f.release(a, b), f.next(a))),
        )
    )
    texts = {s: format_formula(formula, s).replace(" ", "") for s in SYNTAXES}
    assert all(len(set(map(t.count, "()"))) == 1 for t in texts.values())
    assert "[](!(p0))" in texts["spin"]
    assert "<>(p1)" in texts["spin"]
    assert "(p0Vp1)" in texts["spin"]
    assert "&&" in texts["spin"]
    assert "(p0Rp1)" in texts["spot"]
    assert "G(!(p0))" in texts["rabinizer"]
    with pytest.raises(UsageError, match="lbt, spin, spot, rabinizer"):
        format_formula(formula, "prolog")


@pytest.fixture
def tool(tmp_path: Path):
    def write(code: str) -> str:
        path = tmp_path / "translator"
        path.write_text(f"#!{sys.executable}\nimport sys\n{code}\n")
        path.chmod(0o755)
        return str(path)

    return write


BUCHI = (
    'HOA: v1 Start: 0 AP: 1 "p0" Acceptance: 1 Inf(0) --BODY-- State: 0 [0] 0 {0} [!0] 0 --END--'
)


def test_a_translator_is_given_the_formula_and_writes_the_automaton(tool):
    f = LtlFactory()
    program = tool(
        f"assert open(sys.argv[1]).read() == 'G F p0\\n'\nopen(sys.argv[2], 'w').write({BUCHI!r})"
    )
    automaton = translate_externally(program, "lbt", f.always(f.eventually(f.literal(0))), range(2))
    assert automaton.accepts([], [0, 1])
    assert not automaton.accepts([1], [0])


@pytest.mark.parametrize(
    ("code", "error", "text"),
    [
        ("sys.exit('out of ideas')", UnsupportedError, r"exit status 1: out of ideas"),
        ("print('done')", UnsupportedError, "wrote no automaton: done"),
        ("open(sys.argv[2], 'w').write('digraph {}')", InputError, "<automaton of translator>:1:1"),
    ],
)
def test_a_translator_that_fails(tool, code, error, text):
    f = LtlFactory()
    with pytest.raises(error, match=text):
        translate_externally(tool(code), "lbt", f.literal(0), range(2))


def test_a_translator_that_is_missing(tmp_path):
    with pytest.raises(UsageError, match="cannot be run"):
        translate_externally(str(tmp_path / "nothing"), "lbt", LtlFactory().literal(0), range(2))
