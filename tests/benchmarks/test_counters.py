"""No work has been added: nodes, operations, iterations and memory are what they were (see benchmarks/counters.py)."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import counters

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def test_nothing_has_grown():
    """In a process of its own: what others have imported or cached would be counted too."""
    ran = subprocess.run(
        [sys.executable, str(BENCHMARKS / "counters.py")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout[-2000:] + ran.stderr


def test_growth_is_noticed():
    reference = json.loads(counters.REFERENCE.read_text())
    name = next(iter(reference))
    worse = {**reference, name: {**reference[name], "lookups": 2 * reference[name]["lookups"]}}
    assert counters.grown(reference, reference) == []
    assert [line.split(": ")[1].split()[0] for line in counters.grown(worse, reference)] == [
        "lookups"
    ]


def test_a_case_cannot_be_dropped():
    reference = json.loads(counters.REFERENCE.read_text())
    name = next(iter(reference))
    assert counters.grown({k: v for k, v in reference.items() if k != name}, reference)


def test_the_number_of_states_is_exact():
    reference = json.loads(counters.REFERENCE.read_text())
    name = next(iter(reference))
    wrong = {**reference, name: {**reference[name], "states": reference[name]["states"] - 1}}
    assert len(counters.grown(wrong, reference)) == 1


def test_a_small_run_imports_few_libraries():
    """Each of scipy, matplotlib, dd (with CUDD), flint and rich costs more than the whole run.

    Lark is only imported by the first run, which analyses the grammars.
    """
    counters.imported()
    roots = {name.partition(".")[0] for name in counters.imported()} - sys.stdlib_module_names
    assert {name for name in roots if "cython" not in name} == {"numpy", "symcheck"}


def test_modules_may_not_creep_in():
    reference = json.loads(counters.REFERENCE.read_text())
    more = {**reference, "start-up": {"modules": reference["start-up"]["modules"] + 3}}
    assert len(counters.grown(more, reference)) == 1
