"""Faults have a place, the right words and a hint. No text raises anything but a SyntaxFault."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from symcheck.errors import SyntaxFault, UsageError
from symcheck.syntax.parse import (
    parse_expression,
    parse_model,
    parse_model_file,
    parse_properties,
    parse_properties_file,
)
from symcheck.syntax.tree_builder import MAX_NESTING
from syntax.cases import FOLDER, outcome, read
from syntax.samples import MODEL, PROPERTIES


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.case")), ids=lambda p: p.stem)
def test_case(path: Path) -> None:
    sections = read(path)
    if "levels deep" in sections["error"] and MAX_NESTING != 2000:
        pytest.skip(f"this Python takes no more than {MAX_NESTING} levels")
    assert outcome(sections) == sections["error"]
    assert sections["error"] != "no error\n"


def test_what_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "model.pm"
    path.write_bytes(b"\x7fELF\0\0")
    with pytest.raises(UsageError, match="not a UTF-8 text file"):
        parse_model_file(path)


def reads_or_complains(text: str) -> None:
    for parse in (parse_model, parse_properties, parse_expression):
        try:
            parse(text)
        except SyntaxFault as fault:
            complaint = str(fault)
        else:
            continue
        assert complaint


@given(st.text())
def test_any_text(text: str) -> None:
    reads_or_complains(text)


@given(st.binary())
def test_any_bytes(data: bytes) -> None:
    reads_or_complains(data.decode("latin-1"))


WORDS = [
    *(
        "module",
        "endmodule",
        "rewards",
        "endrewards",
        "init",
        "endinit",
        "system",
        "endsystem",
        "const",
        "label",
        "formula",
        "global",
    ),
    *(
        "[",
        "]",
        "(",
        ")",
        "{",
        "}",
        ";",
        ":",
        ",",
        "'",
        "..",
        "->",
        "<-",
        "=",
        "==",
        "<=",
        "=>",
        "<=>",
        "&",
        "|",
        "||",
        "|[",
        "]|",
        "!",
    ),
    *(
        "+",
        "-",
        "*",
        "/",
        "^",
        "?",
        '"',
        '"a"',
        "x",
        "P",
        "R",
        "S",
        "F",
        "U",
        "=?",
        "1",
        "0.5",
        "1e9",
        "filter",
        "multi",
        "max",
        "\n",
    ),
]


@given(st.lists(st.sampled_from(WORDS)))
def test_any_words(words: list[str]) -> None:
    reads_or_complains(" ".join(words))


@pytest.mark.parametrize("seed", range(150))
def test_damaged_texts(seed: int) -> None:
    chance = random.Random(seed)
    for text in (MODEL, PROPERTIES):
        for _ in range(chance.randint(1, 4)):
            i = chance.randrange(len(text))
            text = (
                text[:i]
                + chance.choice(["", chance.choice(WORDS), text[i : i + 30]])
                + text[i + chance.randrange(4) :]
            )
        reads_or_complains(text)


@pytest.mark.parametrize(
    "text",
    [
        "(" * 20_000,
        "(" * 20_000 + "1" + ")" * 20_000,
        "!" * 20_000 + "true",
        "-" * 20_000 + "1",
        "2^" * 20_000 + "1",
        "1-" * 20_000 + "1",
        "x?1:" * 20_000 + "1",
        "P>0[ F " * 20_000,
        "P=? [ " + "F " * 20_000 + "x ]",
        "(1+" * 20_000 + "1" + ")" * 20_000,
        "a => " * 20_000 + "b",
        "!" * 20_000 + "a = b",
        "9" * 20_000,
        "1e" + "9" * 20_000,
        "0." + "9" * 20_000,
        '"' * 10_000,
        "[;" * 10_000,
        "\0" * 10_000,
    ],
    ids=lambda text: text[:6],
)
def test_huge_texts_end_quickly(text: str) -> None:
    reads_or_complains(text)


def test_what_was_put_in_is_never_shown() -> None:
    """An excerpt shows the text as it was typed, also after a missing word was put in."""
    text = "dtmc\nmodule m\n  x : [0..1]\n  [] x=0 -> (x'=1;\nmodule n\n  y : [0..1 init 0;\n"
    with pytest.raises(SyntaxFault) as caught:
        parse_model(text)
    lines = text.splitlines()
    for diagnostic in caught.value.diagnostics:
        shown = [line for line in str(diagnostic).splitlines() if " | " in line]
        assert [line.partition(" | ")[2] in lines for line in shown] == [True]
        assert diagnostic.span.text
        assert diagnostic.span.text in text


def test_a_part_is_there_once_though_it_is_read_twice() -> None:
    with pytest.raises(SyntaxFault) as caught:
        parse_model("dtmc init x=1 endinit system a || endsystem")
    assert len(caught.value.diagnostics) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = !y", "'!' cannot stand behind '='"),
        ("a & x + !y < 1", "'!' cannot stand behind '+'"),
        ("-!x", "'!' cannot stand behind '-'"),
        ("- - !!x", "'!' cannot stand behind '-'"),
    ],
)
def test_negation_binds_too_loosely(text: str, message: str) -> None:
    with pytest.raises(SyntaxFault) as caught:
        parse_expression(text)
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.message == message
    assert diagnostic.span.text == "!"


def test_deep_but_bearable() -> None:
    levels = MAX_NESTING - 10
    nested = parse_expression("x-" * levels + "x")
    assert nested == parse_expression("x-" * levels + "x")
    with pytest.raises(SyntaxFault, match="levels deep"):
        parse_expression("x-" * (MAX_NESTING + 10) + "x")


def test_faults_in_order_and_one_a_line() -> None:
    with pytest.raises(SyntaxFault) as caught:
        parse_properties("P=? [ F ];\nP=? [ x== 1 && ];\nx=1;\nR=? [ Q ;")
    lines = [d.span.source.position(d.span.start)[0] for d in caught.value.diagnostics]
    assert lines == [1, 2, 4]


def test_files(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"cannot read .*none\.pm"):
        parse_model_file(tmp_path / "none.pm")
    with pytest.raises(UsageError, match="cannot read"):
        parse_properties_file(tmp_path)
    (tmp_path / "old.pm").write_bytes("// Gr\xf6\xdfe\nctmc\n".encode("latin-1"))
    assert parse_model_file(tmp_path / "old.pm") == parse_model("ctmc")
    (tmp_path / "marked.pm").write_bytes(b"\xef\xbb\xbfdtmc\r\n")
    assert parse_model_file(str(tmp_path / "marked.pm")) == parse_model("dtmc")
