"""The parsers of the two grammars, and the cache that they are kept in."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache as cached
from pathlib import Path

import lark
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symcheck.syntax import grammars
from symcheck.syntax.parse import parse_expression, parse_model, parse_properties
from syntax.samples import MODEL, PROPERTIES

PARSE = """
from symcheck.syntax.parse import parse_model
print(len(parse_model('dtmc module m x:[0..1]; endmodule').modules))
"""


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache directory."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    grammars.load.cache_clear()
    yield tmp_path / "symcheck"
    grammars.load.cache_clear()


def read_again() -> None:
    """Parse in what could be another run."""
    grammars.load.cache_clear()
    parse_model(MODEL)
    parse_properties(PROPERTIES)


def built(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A list that the grammars are added to that Lark analyses from now on."""
    texts: list[str] = []
    analyse = lark.Lark.__init__

    def noting(self: lark.Lark, grammar: str, **options: object) -> None:
        texts.append(grammar)
        analyse(self, grammar, **options)

    monkeypatch.setattr(lark.Lark, "__init__", noting)
    return texts


def test_a_grammar_is_analysed_once(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program, file = parse_model(MODEL), parse_properties(PROPERTIES)
    texts = built(monkeypatch)
    read_again()
    assert not texts
    assert parse_model(MODEL) == program
    assert parse_properties(PROPERTIES) == file
    assert [path.suffix for path in sorted(cache.iterdir())] == [".tables", ".tables"]


def test_a_model_needs_no_properties_grammar(cache: Path) -> None:
    parse_model(MODEL)
    assert [path.name.partition("-")[0] for path in cache.iterdir()] == ["prism"]


def test_a_cache_of_another_grammar_or_version_is_not_read(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read_again()
    monkeypatch.setattr(grammars, "_lark_version", lambda: "1.2.99")
    texts = built(monkeypatch)
    read_again()
    assert len(texts) == 2
    longer = {name: grammars.grammar_text(name) + "\n" for name in ("prism", "properties")}
    monkeypatch.setattr(grammars, "grammar_text", longer.__getitem__)
    read_again()
    for text, name in zip(texts[2:], longer, strict=True):
        assert text.startswith(longer[name])
    assert len(list(cache.iterdir())) == 6


@pytest.mark.parametrize("rubbish", [b"", b"N", b"no tables", bytes(1000)])
def test_a_broken_cache_is_replaced(
    cache: Path, monkeypatch: pytest.MonkeyPatch, rubbish: bytes
) -> None:
    read_again()
    for path in cache.iterdir():
        path.write_bytes(rubbish or path.read_bytes()[:1000])
    texts = built(monkeypatch)
    read_again()
    assert len(texts) == 2
    read_again()
    assert len(texts) == 2


def test_a_directory_that_cannot_be_written(tmp_path: Path, cache: Path) -> None:
    cache.write_text("a file, where the directory should be")
    read_again()
    assert list(tmp_path.iterdir()) == [cache]


def test_a_user_without_a_home(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert grammars.cache_directory() is None
    read_again()
    assert not Path("relative").exists()


def test_a_save_that_fails_leaves_nothing(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", failing)
    read_again()
    assert not list(cache.iterdir())


@pytest.mark.parametrize("name", ["prism", "properties"])
def test_every_rule_has_a_method(name: str) -> None:
    """But for rules that have the value of one part, and for lists and templates of the grammar."""
    language = grammars.load(name)
    named = {
        rule.alias or str(rule.origin.name)
        for rule in grammars.analysed(name).rules
        if rule.alias or not rule.options.expand1
    }
    missing = {
        n for n in named if not hasattr(language.builder, n) and n[0] != "_" and "{" not in n
    }
    assert missing == {"misplaced"}, "syntax/tree_builder.py"


@pytest.mark.parametrize(
    ("word", "reserved"),
    [
        *dict.fromkeys(("module", "init", "endinit", "P", "Pmax", "filter", "floor"), True).items(),
        *dict.fromkeys(("x", "initial", "endings", "Pmaximal", "mini", "T", "e_1"), False).items(),
    ],
)
def test_the_grammar_says_which_words_are_reserved(word: str, reserved: bool) -> None:
    assert grammars.load("prism").reserves(word) is reserved


def test_two_processes_at_once(cache: Path) -> None:
    runs = [
        subprocess.Popen([sys.executable, "-c", PARSE], stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    assert [run.communicate()[0] for run in runs] == ["1\n"] * 3
    assert [path.suffix for path in cache.iterdir()] == [".tables"]


def test_two_threads_at_once() -> None:
    """A builder serves one text at a time; the others wait."""
    texts = [f"x{i} + {'y * ' * 300}z{i}" for i in range(20)]
    alone = [parse_expression(text) for text in texts]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(parse_expression, texts))
    assert together == alone
    assert [tree.span.source.text for tree in together] == texts


WORDS = st.sampled_from(
    [
        *("pta", "ma", "module", "floor", "(", "min", "P", "Pmax", "filter", "// x\n", "1e5", "1."),
        *("..", "...", ".5", '"a"', '"a b"', "AG", "=?", "smg", "const", "endinit", "'", "->", " "),
    ]
)


def test_a_known_grammar_needs_no_lark(cache: Path) -> None:
    read_again()
    run = subprocess.run(
        [sys.executable, "-c", f"{PARSE}import sys; print('lark' in sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout == "1\nFalse\n"


analysed = cached(grammars.analysed)


@pytest.mark.parametrize("name", ["prism", "properties"])
@given(
    text=st.text('ab01.eE"/\n\t\v\x85é <>=!&|:;,()[]{}^%*+-?PRF_') | st.lists(WORDS).map("".join)
)
def test_words_are_those_of_lark(name: str, text: str) -> None:
    language = grammars.load(name)
    assert [(w.type, w.value, w.start_pos, w.end_pos) for w in language.lexer.words(text)] == [
        (t.type, t.value, t.start_pos, t.end_pos) for t in analysed(name).lex(text)
    ]
