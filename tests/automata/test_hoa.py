from __future__ import annotations

from random import Random

import pytest

from automata.words import holds, made, random_tree, random_word
from symcheck.automata import hoa
from symcheck.automata.ltl import LtlFactory
from symcheck.automata.translate import translate
from symcheck.errors import InputError

ATOMS = {"p0": 0, "p1": 1, "p2": 2}


def test_what_is_written_reads_back_as_the_same_language():
    random = Random(3)
    for _ in range(80):
        tree = random_tree(random, 3, random.randint(1, 8))
        formulas = LtlFactory()
        automaton = translate(formulas, made(formulas, tree), range(8))
        back = hoa.read(hoa.write(automaton, range(8), list(ATOMS)), range(8), ATOMS)
        assert back.states <= automaton.states
        for _ in range(20):
            word = random_word(random, 8)
            assert back.accepts(*word) == holds(tree, *word)


def _text(acceptance: str, body: str, start: str = "Start: 0") -> str:
    return f'HOA: v1\nStates: 2\n{start}\nAP: 2 "p0" "p1"\nAcceptance: {acceptance}\n--BODY--\n{body}\n--END--\n'


# Each accepts GF p0 & FG !p1, or GF p0.
SAMPLES = {
    "edges, explicit labels": (_text("2 Inf(0) & Fin(1)", "State: 0 [0&!1] 0 {0} [!0&!1] 0 [0&1] 0 {0 1} [!0&1] 0 {1}"), True),
    "implicit labels": (_text("2 Inf(0) & Fin(1)", "State: 0 0 0 {0} 0 {1} 0 {0 1}"), True),
    "states": (_text("1 Inf(0)", "State: 0 [0] 1 [!0] 0 State: 1 {0} [0] 1 [!0] 0"), False),
    "state labels": (_text("1 Inf(0)", "State: 0 [t] 1 State: 1 [0] 1 {0} [!0] 1"), False),
    "complements": (_text("2 Inf(!0) & Fin(!1)", "State: 0 [0&!1] 0 {1} [!0&!1] 0 {0 1} [0&1] 0 [!0&1] 0 {0}"), True),
    "alternatives": (_text("3 (Inf(0) | Inf(2)) & (Fin(1) | f)", "State: 0 [0&!1] 0 {2} [!0&!1] 0 [1] 0 {1}"), True),
    "missing edges reject": (_text("1 Inf(0)", "State: 0 [!1] 1 State: 1 [0] 1 {0} [!0] 1", "Start: 1"), False),
    "aliases and comments": (
        'HOA: v1 /* a\n comment */ name: "x" States: 1 Start: 0 AP: 2 "p1" "p0" Alias: @a 1 & !0 Alias: @b !@a '
        "acc-name: Buchi Acceptance: 1 Inf(0) properties: deterministic some-thing: 1 2\n"
        "--BODY-- State: 0 \"first\" [1] 0 {0} [!1 & (@a | @b)] 0 --END--",
        False,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SAMPLES)
def test_forms(name):
    text, without = SAMPLES[name]
    automaton = hoa.read(text, range(4), {"p0": 0, "p1": 1})
    random = Random(1)
    for _ in range(60):
        prefix, period = random_word(random, 4)
        often, never = any(a & 1 for a in period), not any(a & 2 for a in period)
        assert automaton.accepts(prefix, period) == (often and (never or not without)), (
            prefix,
            period,
        )


FAULTS = {
    "HOA: v2": "'HOA: v1' is expected",
    "hello": "'HOA: v1' is expected",
    _text("1 Inf(1)", ""): "there are 1 acceptance sets",
    _text("1 Inf(0", ""): r"'\)' is expected",
    _text("1 Inf(0)", "State: 0 [0] 0 [t] 1"): "not deterministic",
    _text("1 Inf(0)", "State: 0 [5] 0"): "there are 2 atoms",
    _text("1 Inf(0)", "State: 0 [0] 0&1"): "alternating",
    _text("1 Inf(0)", "", "Start: 0 Start: 1"): "one initial state",
    _text("1 Inf(0)", "State: 99999999999 [0] 0"): "too large",
    _text("1 Inf(0)", "").replace("p1", "q"): 'has no atom "q"',
    _text("1 Inf(0)", "").replace("--END--", "--ABORT--"): "'--END--' or 'State:' is expected",
    _text("1 Inf(0)", "").replace("--END--", ""): "'--END--' or 'State:' is expected",
    _text("1 Inf(0)", "?"): "not a word",
    _text("1 Inf(0)", "State: 0 [@a] 0"): "there is no alias @a",
    _text("1 Inf(0)", "").replace("AP: 2", "AP: 3"): "3 names of atoms are expected",
    "HOA: v1 Start: 0 --BODY-- --END--": "acceptance condition is missing",
}


@pytest.mark.parametrize("text", FAULTS)
def test_faults_are_said(text):
    with pytest.raises(InputError, match=FAULTS[text]):
        hoa.read(text, range(4), {"p0": 0, "p1": 1})


@pytest.mark.parametrize("seed", range(40))
def test_broken_text_is_a_fault_or_an_automaton(seed):
    random = Random(seed)
    text = random.choice([t for t, _ in SAMPLES.values()])
    for _ in range(random.randint(1, 4)):
        at = random.randrange(len(text))
        text = (
            text[:at]
            + random.choice(["", "0", "{", "]", "!", "Inf(", "State: 1", '"', "&"])
            + text[at + random.randint(0, 3) :]
        )
    try:
        automaton = hoa.read(text, range(4), {"p0": 0, "p1": 1})
    except InputError:
        return
    assert automaton.letters == 4
