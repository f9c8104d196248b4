"""A properties text with faults: what is left of it."""

from __future__ import annotations

import pytest

from symcheck.errors import SyntaxFault
from symcheck.syntax import properties_in_part
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.properties_in_part import parse_properties_in_part


def test_what_follows_the_grammar_is_parsed() -> None:
    text = 'P=? [ F x=1 ];\n// RESULT: 1\n"bad": P=? [\n  F x= ];\nconst int k = ;\nx=k;\n'
    found = parse_properties_in_part(text, "p.pctl")
    assert [p.span.text for p in found.parsed.properties] == ["P=? [ F x=1 ]", "x=k"]
    (index, faulty), *others = found.unparsed.items()
    assert (index, others) == (1, [])
    assert (faulty.text, faulty.comments) == ('"bad": P=? [ F x= ]', ("RESULT: 1",))
    assert text[faulty.span.start : faulty.span.end] == '"bad": P=? [\n  F x= ]'
    assert [str(d.span) for d in found.diagnostics] == ["p.pctl:4:8", "p.pctl:5:15"]


def test_a_text_may_consist_of_faults() -> None:
    found = parse_properties_in_part("P=? [ F x=; P=? [ G")
    assert found.parsed.properties == ()
    assert [p.text for p in found.unparsed.values()] == ["P=? [ F x=", "P=? [ G"]


def test_a_model_is_refused_as_a_whole() -> None:
    with pytest.raises(SyntaxFault, match="this is a part of a model") as fault:
        parse_properties_in_part("dtmc\nconst int k = 1;\nmodule m x : bool; endmodule\n")
    assert len(fault.value.diagnostics) == 1


def test_properties_without_faults_are_read_once_however_long_the_text_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A text of n properties with one fault takes time in proportion to n, not to its square."""
    text = "".join(f"P=? [ F s={i} ];\n" for i in range(50)) + "P=? [ F ;\n"
    sizes: list[int] = []
    parse = properties_in_part.parse_properties

    def counted(text: str, *arguments: str, **named: str) -> PropertiesFile:
        sizes.append(len(text))
        return parse(text, *arguments, **named)

    monkeypatch.setattr(properties_in_part, "parse_properties", counted)
    found = parse_properties_in_part(text)
    assert list(found.unparsed) == [50]
    assert sum(sizes) < 5 * len(text)
