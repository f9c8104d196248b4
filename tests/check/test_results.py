"""The results of several properties: by name, by index, one after the other."""

from __future__ import annotations

from pathlib import Path

import pytest

import symcheck
from symcheck.errors import NameFault

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
