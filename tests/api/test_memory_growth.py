"""A process that checks for a long time does not grow: neither objects nor memory of compiled code."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import gc, resource
from random import Random

import symcheck
from generate import random_model
from symcheck.dd.cudd_import import available
from symcheck.errors import SymcheckError

ENGINES = ("explicit", "exact") + ("sparse", "hybrid", "mtbdd") * available()
QUESTIONS = ('P{}=? [ F "b" ]', 'R{{"r"}}{}=? [ C<=2 ]', 'P{}>0.5 [ G (F "a") ]', 'S{}=? [ "a" ]')


def checks(count):
    for i in range(count):
        kind = ("dtmc", "ctmc", "mdp")[i % 3]
        text = random_model(Random(i % 60), kind).text  # later rounds meet what caches know
        question = QUESTIONS[i % len(QUESTIONS)].format("max" if kind == "mdp" else "")
        try:
            symcheck.loads(text, engine=ENGINES[i % len(ENGINES)]).check(question)
        except SymcheckError:
            pass
    gc.collect()
    pages = int(open("/proc/self/statm").read().split()[1])
    return len(gc.get_objects()), pages * resource.getpagesize() / 2**20


objects, megabytes = checks(240)
more_objects, more_megabytes = checks(400)
print(more_objects - objects, more_megabytes - megabytes)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
def test_hundreds_of_checks_leave_nothing_behind():
    path = os.pathsep.join([str(Path(__file__).parents[1]), *filter(None, sys.path)])
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    objects, megabytes = map(float, ran.stdout.split())
    assert objects < 200  # one of each check would be a leak
    assert megabytes < 3
