"""The results of several properties: by name, by index, one after the other."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import pytest

import symcheck
from symcheck.errors import NameFault
from symcheck.tables import plain_text

DIE = Path(__file__).resolve().parents[2] / "models" / "die" / "die.pm"
PROPERTIES = '"six": P=? [ F d=6 ]; "tosses": R=? [ F "done" ]; P=? [ F d=1 ]'


def test_results_are_found_by_name_and_by_index() -> None:
    results = symcheck.load(DIE).check_all(PROPERTIES)
    assert results["tosses"] is results[1]
    assert results[-1].value == results["six"].value
    assert ("six" in results, "seven" in results, None in results) == (True, False, False)
    assert [bound.name for bound, _ in results] == ["six", "tosses", None]
    assert list(results) == []


def test_only_results_that_are_asked_for_are_kept() -> None:
    results = symcheck.load(DIE).check_all(PROPERTIES)
    by_iteration = [result for _, result in results]
    assert results[0] is not by_iteration[0]
    assert results[0] is results["six"]


@pytest.mark.parametrize(
    ("key", "error"), [("seven", KeyError), (3, IndexError), (slice(0, 1), TypeError)]
)
def test_what_has_no_result_is_an_error(key: object, error: type[Exception]) -> None:
    with pytest.raises(error):
        symcheck.load(DIE).check_all(PROPERTIES)[key]  # type: ignore[index]


def test_nothing_is_built_for_faulty_properties_alone() -> None:
    die = symcheck.load(DIE)
    with pytest.raises(NameFault):
        die.check("P=? [ F foo=1 ]")
    assert not die.is_built


def test_a_faulty_property_does_not_keep_others_from_their_results() -> None:
    results = symcheck.load(DIE).check_all('P=? [ F foo=1 ]; "six": P=? [ F d=6 ]')
    assert results["six"].value == pytest.approx(1 / 6)
    with pytest.raises(NameFault):
        results[0]


@pytest.fixture
def short_numbers() -> Iterator[None]:
    """Python writes whole numbers of up to 4300 digits."""
    limit = sys.get_int_max_str_digits()
    sys.set_int_max_str_digits(4300)
    yield
    sys.set_int_max_str_digits(limit)


@pytest.mark.usefixtures("short_numbers")
def test_a_long_fraction_is_shown_as_on_the_command_line(tmp_path: Path) -> None:
    text = "dtmc module m x:[0..1]; [] x=0 -> 1e-10:(x'=1) + 1-1e-10:(x'=0); endmodule"
    model = symcheck.loads(text, exact=True)
    result = model.check("P=? [ F<=1000 x=1 ]")
    above, below = str(result).removesuffix(" (exact)").split("/")
    assert Fraction(Decimal(above)) / Fraction(Decimal(below)) == result.value
    assert len(below) > 4300
    shown = f"{above}/{below}"
    assert f"value={shown}, accuracy=Exact(" in repr(result)
    assert shown in result._repr_html_()
    assert shown in str(result.values)
    assert shown in str(model.transient(1000))
    for extension in ("csv", "json"):
        symcheck.experiment(model, "P=? [ F<=1000 x=1 ]").save(tmp_path / f"r.{extension}")
        assert shown in (tmp_path / f"r.{extension}").read_text()
    assert str(model.check("P=? [ F<=1000 x=1 ] - 1")).startswith("-")
    assert plain_text(-(10**9999)) == "-1" + "0" * 9999
    assert plain_text(10**9999 - 1) == "9" * 9999
