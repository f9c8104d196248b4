"""Where dd has no compiled module: a shared library with CUDD, or no diagrams at all."""

from __future__ import annotations

from pathlib import Path

import dd.cudd
import pytest

from without_cudd import run

CHECK = """
for engine in {engines}:
    model = symcheck.load("dining/dining.nm", engine=engine)
    print(model.check('Pmin=? [ F<=20 "eating" ]').value, len(model.states), model.engine.name)
"""


WAYS = {
    "the variable SYMCHECK_CUDD": ("", {"SYMCHECK_CUDD": "libcudd.so"}),
    "the folder of Python's libraries": ("import sys; sys.base_prefix = {folder!r}\n", {}),
    "the loader of the system": ("", {"LD_LIBRARY_PATH": "lib"}),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_shared_library_replaces_the_module_of_dd(way: str, tmp_path: Path) -> None:
    """The module of dd is itself a shared library that exports CUDD."""
    library = tmp_path / "lib" / "libcudd.so"
    library.parent.mkdir()
    library.symlink_to(dd.cudd.__file__)
    code, variables = WAYS[way]
    places = {"libcudd.so": str(library), "lib": str(library.parent)}
    engines = ["explicit", "sparse", "hybrid", "mtbdd"]
    lines = run(
        code.format(folder=str(tmp_path)) + CHECK.format(engines=engines),
        **{name: places[place] for name, place in variables.items()},
    )
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

    (line, hint) = run(code, SYMCHECK_CUDD=_ctypes.__file__)
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


BUILT = 'symcheck.reach(symcheck.build(symcheck.load("die/die.pm").bound, symcheck.Options()))'


@pytest.mark.parametrize(
    "call",
    [
        'symcheck.load("die/die.pm", engine="hybrid").engine',
        'view.picture(symcheck.load("die/die.pm"))',
        'teach.prob0(symcheck.load("dining/dining.nm"), "true", "p1=5")',
        'teach.block_structure(symcheck.load("die/die.pm"))',
        "from symcheck.dd.manager import DiagramManager; DiagramManager()",
    ],
)
def test_without_cudd_diagrams_say_what_is_missing(call: str) -> None:
    (message, hint) = fault(call)
    assert message == "decision diagrams need CUDD, which is not installed here"
    assert "SYMCHECK_CUDD names a shared library" in hint


@pytest.mark.parametrize(
    "call",
    [
        f"from symcheck.symbolic.matrix.transitions import transitions; "
        f"transitions({BUILT}, symcheck.Options())",
        'teach.prob0(symcheck.load("die/die.pm"), "true", "P>0.5 [ F d=6 ]")',
        'list(teach.frontiers(symcheck.loads("dtmc module m x:[0..3]; '
        "[] x>0 -> x/3:(x'=x-1) + 1-x/3:true; endmodule\")))",
    ],
)
def test_without_cudd_sets_work_and_numbers_say_what_is_missing(call: str) -> None:
    """A matrix, and probabilities that depend on the state, need MTBDDs."""
    (message, hint) = fault(call)
    assert "(MTBDDs) need CUDD, which is not installed here" in message
    assert "SYMCHECK_CUDD names a shared library" in hint


def fault(call: str) -> list[str]:
    """The lines of the error that a call raises where there is no CUDD."""
    code = f"""
try:
    {call}
except symcheck.SymcheckError as error:
    print(error)
"""
    return run(code)
