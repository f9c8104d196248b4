"""Where dd has no compiled module: a shared library with CUDD, or no diagrams at all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import dd.cudd
import pytest

MODELS = Path(__file__).resolve().parents[2] / "models"
WITHOUT_DD = """
import sys
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name == "dd.cudd":
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Hidden())
import symcheck
from symcheck import teach, view
"""


def run(code: str, cudd: str = "") -> list[str]:
    """The lines that Python prints where dd has no CUDD; `cudd` is the file of a shared library."""
    environment = {k: v for k, v in os.environ.items() if k != "SYMCHECK_CUDD"}
    if cudd:
        environment["SYMCHECK_CUDD"] = cudd
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_DD + code],
        capture_output=True,
        text=True,
        cwd=MODELS,
        env=environment,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


CHECK = """
for engine in {engines}:
    model = symcheck.load("dining/dining.nm", engine=engine)
    print(model.check('Pmin=? [ F<=20 "eating" ]').value, len(model.states), model.engine.name)
"""


def test_a_shared_library_replaces_the_module_of_dd() -> None:
    """The module of dd is itself a shared library that exports CUDD."""
    engines = ["explicit", "sparse", "hybrid", "mtbdd"]
    lines = run(CHECK.format(engines=engines), dd.cudd.__file__)
    values = {line.split()[0] for line in lines}
    assert [line.split()[1:] for line in lines] == [["155", engine] for engine in engines]
    assert max(map(float, values)) - min(map(float, values)) < 1e-9


def test_a_library_without_cudd_is_named() -> None:
    code = """
try:
    symcheck.load("die/die.pm", engine="mtbdd").engine
except symcheck.SymcheckError as error:
    print(error)
"""
    import _ctypes

    (line, hint) = run(code, _ctypes.__file__)
    assert line == f"{_ctypes.__file__} does not export Cudd_ReadOne"
    assert "dd 0.6.0" in hint


def test_without_cudd_all_but_diagrams_works() -> None:
    """The default engine, rationals, simulation, experiments and pages."""
    code = """
print(symcheck.load("crowds/crowds.pm", constants={"TotalRuns": 4, "CrowdSize": 8}).engine.name)
die = symcheck.load("die/die.pm")
print(die.check("P=? [ F d=6 ]").value, die.check("P>=1/6 [ F d=6 ]").value)
print(symcheck.load("die/die.pm", engine="exact").check("P=? [ F d=6 ]").value)
print(len(die.simulate(seed=1, steps=20)) > 3)
print(len(symcheck.experiment("die/die.pm", "const int k; P=? [ F d=k ]", {"k": range(1, 4)})))
print(len(die.page("P=? [ F d=6 ]").data["shows"]) > 3)
print(type(view.state_graph(die)).__name__)
"""
    lines = run(code)
    assert lines[0] == "explicit"
    assert float(lines[1].split()[0]) == pytest.approx(1 / 6)
    assert lines[1].split()[1] == "True"
    assert lines[2] == "1/6"
    assert lines[3:] == ["True", "3", "True", "Picture"]


@pytest.mark.parametrize(
    "call",
    [
        'symcheck.load("die/die.pm", engine="hybrid").engine',
        'view.picture(symcheck.load("die/die.pm"))',
        'list(teach.frontiers(symcheck.load("die/die.pm")))',
        "from symcheck.dd.manager import DiagramManager; DiagramManager()",
    ],
)
def test_without_cudd_diagrams_say_what_is_missing(call: str) -> None:
    code = f"""
try:
    {call}
except symcheck.SymcheckError as error:
    print(error)
"""
    (message, hint) = run(code)
    assert message == "decision diagrams need CUDD, which is not installed here"
    assert "SYMCHECK_CUDD names a shared library" in hint
