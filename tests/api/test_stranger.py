"""A stranger's notebook: each cell works, or its error says what to do, from the outermost code."""

from __future__ import annotations

import linecache
import re
import traceback
from pathlib import Path

import numpy as np
import pytest

import symcheck

DIE = str(Path(__file__).parents[2] / "models/die/die.pm")
WALK = """dtmc const int N; module m x : [0..N]; b : bool;
  [] x<N -> 0.5:(x'=x+1)&(b'=true) + 0.5:(x'=0)&(b'=false); [] x=N -> true; endmodule
  formula top = x=N; label "end" = top; rewards "steps" true : 1; endrewards"""
CELLS = [
    ("load('nosuch.pm')", "UsageError: cannot read nosuch.pm"),
    ("load(WALK)", "UsageError: load takes the name of a file, .*loads takes a text"),
    ("load(3)", "UsageError: load takes the name of a file, not 3"),
    ("loads(DIE)", "UsageError: loads takes the text of a model, .*load reads a file"),
    ("loads(None)", "UsageError: loads takes the text of a model, not None"),
    ("load(DIE, type='mpd')", "UsageError: type='mpd': expected one of dtmc, .*did you mean mdp"),
    ("load(DIE, type='mdp').bound.type.name", "'MDP'"),
    ("load(DIE, engine='sprase')", "UsageError: engine='sprase': .*did you mean 'sparse'"),
    ("load(DIE, epsilon=-1)", "UsageError: epsilon=-1: expected a number between 0 and 1"),
    ("load(DIE, engin='sparse')", "UsageError: there is no option 'engin' .*'engine'"),
    ("load(DIE, {'N': 3})", "NameFault: .*constant N is given a value, but the model has no such"),
    ("loads(WALK, 'n=3')", "NameFault: .*did you mean N"),
    ("loads(WALK, {'N': 2.5})", "TypeFault: .*constant N is of type int"),
    ("loads(WALK, 'N=2.5')", "TypeFault: .*hint: a value of type int is a whole number"),
    ("loads(WALK, 'N=a')", "NameFault: .*unknown name a.*hint: a value is a number, true, false"),
    ("m.check('x=0') == True", r"TypeError: .*compare its value: result.value == True"),
    ("symcheck.view.state_graph(m).render('x.svg')", "UsageError: format='x.svg': .*save.path."),
    ("loads(WALK, 'N=3').constants", "{'N': 3}"),
    ("loads(WALK, 'N=1:3')", "UsageError: constants: N is given 3 values .*one value is expected"),
    ("loads(WALK).states", "NameFault: .*constant N is not defined.*constants='N=VALUE'"),
    ("loads('dtmc module m x : [0..y]; endmodule')", "NameFault: .*unknown name y"),
    ("m.check('P=? [ F x=3')", "SyntaxFault: .*']' is missing"),
    ("m.check('P=? [ F \"ende\" ]')", "NameFault: .*did you mean end"),
    ("m.check('Pmax=? [ F x=3 ]').value", "1.0"),
    ("m.check(3)", "UsageError: a property is a text .*, not 3"),
    ("load('')", "UsageError: the name of a file is empty"),
    ("load('die.tra')", "UsageError: die.tra lists states.*load_explicit"),
    ("m.check(['x=1', 'x=2'])", "UsageError: a property is a text .*check_all takes"),
    ("m.check('die.pctl')", r"UsageError: .*not a file hint: check_all\('die.pctl'\)"),
    ("m.check_all(['x=1'])", "UsageError: properties are a text .*with ; between them"),
    ("m.estimate('P=? [ F x=3 ]', samples=0)", "UsageError: samples=0: expected a whole number"),
    ("m.estimate('P=? [ F x=3 ]', samples='9')", "UsageError: samples='9': expected a whole"),
    ("m.estimate('P=? [ F x=3 ]', seed='x')", "UsageError: seed='x': expected a whole number"),
    ("m.estimate('S=? [ x=3 ]')", "UnsupportedError: .*long-run averages; without sampling they"),
    ("symcheck.from_matrix([[1]], labels=['a'])", "UsageError: labels: expected a mapping"),
    ("symcheck.from_matrix([[1]], rewards=[1])", "UsageError: rewards: expected a mapping"),
    ("symcheck.from_matrix([[1]], groups=[0])", r"UsageError: .*the groups are \[0\]"),
    ("m.simulator().run(-3)", "UsageError: steps=-3: expected a whole number from 0"),
    ("loads(bytes(1000))", "UsageError: loads takes the text of a model, .{90,110}load reads"),
    ("symcheck.teach.frontiers(DIE)", "UsageError: a model is expected, not .*symcheck.load"),
    ("next(iter(m.check_all('x=1')))[0]", "<BoundProperty: x=1>"),
    ("m.simulator().step(7)", "UsageError: there is no choice 7: expected 0"),
    ("m.simulator().step(0, 7)", "UsageError: the choice has no successor 7: expected 0 to 1"),
    ("repr(m.simulator())", "'<Simulator: step 0, (x=0,b=false), 1 choice>'"),
    ("symcheck.view.state_graph(m, sets=m.where('x=1'))", "UsageError: sets: expected a mapping"),
    ("symcheck.view.state_graph(m, around='x=9')", "UsageError: around='x=9': no state is in"),
    ("symcheck.experiment(m, {'a': 'x=1'})", "UsageError: properties are a text or a file, not"),
    ("m.check('P=? [ F unit=1 ]')", "NameFault: .*the variables are x, b; or declare"),
    ("symcheck.view.plot_search(m)", "UsageError: plot_search takes .*teach.frontiers"),
    ("symcheck.view.plot_bounds(m)", "UsageError: plot_bounds takes .*teach.until_trace"),
    ("symcheck.view.plot_blocks(m)", "UsageError: plot_blocks takes teach.block_structure"),
    ("symcheck.view.results(m.check('x=1'))", "UsageError: results takes the pairs of .*check_all"),
    ("symcheck.view.picture(m, part='state')", "UsageError: part='state': expected one of states,"),
    (
        "symcheck.teach.prob1(load(DIE, type='mdp'), 'true', 'd=6')",
        "UsageError: the value depends on the strategy: give a direction.*direction='min'",
    ),
    (
        "symcheck.teach.until_trace(load(DIE, type='mdp'), 'true', 'd=6', direction='Pmin')",
        "UsageError: direction='Pmin': expected min or max",
    ),
    ("m.check('x=1; x=2')", "UsageError: .*check_all takes several"),
    ("m.check('P=? [ F x=3 ]', 'k=1')", "NameFault: .*k is given a value"),
    ("m.check('P=? [ F x=3 ]', method='foo')", "TypeError: .*unexpected keyword .*'method'"),
    (
        "[(str(p), r.value) for p, r in m.check_all('x=0; \"a\": x=1')]",
        "[('x=0', True), ('a', False)]",
    ),
    ("m.check_all('nosuch.pctl')", "UsageError: cannot read nosuch.pctl"),
    ("m.check_all(3)", "UsageError: properties are a text or a file, not 3"),
    ("float(m.check('x=0'))", "TypeError: a number is expected, .*is true"),
    ("bool(m.check('x'))", "TypeError: true or false is expected, .*is 0"),
    ("m.check('x=0').bounds", "TypeError: a number is expected"),
    ("m.check('x=0').values", "NotInResultError: the result has no values per state hint: a num"),
    ("m.check('x').satisfying", "NotInResultError: the result has no satisfying states"),
    ("m.check('x').front", r"NotInResultError: .*no Pareto front hint: multi\("),
    ("m.check('x').witness", r"NotInResultError: .*no witness hint: E \["),
    ("hasattr(m.check('x'), 'values'), hasattr(m.check('x'), 'satisfying')", r"\(True, False\)"),
    ("m.type.value, load(DIE, type='mdp').type.value", r"\('dtmc', 'mdp'\)"),
    ("loads('module m x : [0..1]; endmodule').type.value", "'mdp'"),
    ("m.page(5)", "UsageError: properties are texts or a file, not 5"),
    ("m.page(['x=1', 5])", "UsageError: properties are texts or a file, not"),
    ("symcheck.quotient(m, rewards=['step'])", "UsageError: .*'step' hint: did you mean steps"),
    ("symcheck.quotient('x')", "UsageError: a model is expected, not 'x'"),
    ("symcheck.view.state_graph(3)", "UsageError: a model is expected, not 3"),
    ("symcheck.induced_chain(m, None)", "UsageError: a strategy is expected, .*, not None"),
    ("symcheck.induced_chain(m, m.check('x'))", "NoStrategyError: the result has no strategy"),
    ("s[{'x': 0}], s[0], s[GAME.states[0]], s[(0,)]", r"\('go', 'go', 'go', 'go'\)"),
    ("s[9]", "IndexError: state 9 of 3 states"),
    ("s['go']", "TypeError: a state is given by its number"),
    ("dict(s)", r"{\(x=0\): 'go', \(x=1\): 'back', \(x=2\): ''}"),
    ("t[0]", r"TypeError: the strategy has memory: expected strategy\[state, memory\], not 0"),
    ("t[0, 7]", r"KeyError: .*the state \(x=0\) never has the memory 7"),
    ("len(t) == len(dict(t)), t[GAME.states[0], list(t)[0][1]]", r"\(True, 'go'\)"),
    ("str(m.states).splitlines()[-1], '…' in str(m.states)", r"\('4 of 4 states', False\)"),
    ("str(load(DIE).states).splitlines()[-2]", "'…      …  …'"),
    (
        "'…' in str(load(DIE).transitions), '…' in str(load(DIE).check('s').values)",
        r"\(True, True\)",
    ),
    ("'…' in str(load(DIE).steady_state())", "False"),
    (
        "m.check('x').values['x']",
        "TypeError: a state is given by its number, or by the values of x, b",
    ),
    ("m.check('x').values[99]", "IndexError: state 99 of 4 states"),
    ("m.check('x').values[{'x': 3, 'b': True}]", "3.0"),
    ("sum(m.check('x').values)", "6.0"),
    ("m.where('x=1 | top')", "<States: 2 of 4>"),
    ("m.where('x')", "UsageError: a condition is expected, and x is a number"),
    ("m.where('y=1')", "NameFault: .*unknown name y"),
    ("m.engine.where('x=1')", "TypeError: an engine takes a bound expression; model.where"),
    ("m.states & {0, 1}", "TypeError: a set of states is expected"),
    ("m.states & load(DIE).states", "TypeError: the sets are of different models"),
    ("m.states['x=1']", "TypeError: .*model.where"),
    ("m.states[{'x': 1.5, 'b': False}]", "TypeError: x=1.5: a variable has an integer or a truth"),
    ("m.states[{'x': 2**70, 'b': False}]", "KeyError: .*is not reachable"),
    ("m.states[{'x': np.int8(1), 'b': np.True_}]", r"\(x=1, b=true\)"),
    ("m.states[{'x': 1}]", "KeyError: .*has values of x, b; given are those of x; model.where"),
    ("m.states[{'x': 1, 'b': False}]", r"KeyError: .*\(1,false\) of \(x, b\) is not reachable"),
    ("m.states[0]['y']", "KeyError: .*there is no 'y', there are x, b"),
    ("m.labels[3]", "KeyError: .*there is no 3, there are "),
    ("m.labels['edn']", "KeyError: .*did you mean end"),
    ("m.rewards['stps'].states", "KeyError: .*did you mean steps"),
    ("m.transient('soon')", "UsageError: a time is a number that is not negative, not 'soon'"),
    ("m.transient(2, [1, 0])", "UsageError: the initial distribution has 2 probabilities"),
    ("m.steady_state()[3]", "1.0"),
    ("m.simulate('x')", "UsageError: steps='x': expected a whole number"),
    ("m.estimate('P=? [ F x=3 ]', method='foo')", "UsageError: method='foo': expected one of ci"),
    (
        "load(DIE, type='mdp').transient(1)",
        r"UnsupportedError: an MDP has no transient distribution.*induced_chain.*-importstrat",
    ),
    ("np.asarray(m.check('x').values).tolist()", "[0.0, 1.0, 2.0, 3.0]"),
    ("symcheck.laod", "AttributeError: module 'symcheck' has no attribute 'laod'"),
    ("symcheck.view, symcheck.teach", r"\(<module 'symcheck.view'.*<module 'symcheck.teach'.*"),
]
GAME = symcheck.loads(
    "mdp module m x:[0..2]; [go] x=0 -> (x'=1); [stay] x=0 -> true; [back] x=1 -> 0.5:(x'=0)"
    "+0.5:(x'=2); endmodule",
    strategy=True,
)
PACKAGE = Path(symcheck.__file__).parent
INNER = ("dd", "kernels", "explicit", "symbolic", "numerics", "matrices", "automata")


@pytest.mark.parametrize(("cell", "expected"), CELLS, ids=[c for c, _ in CELLS])
def test_cell(cell: str, expected: str) -> None:
    names = {
        "symcheck": symcheck,
        "np": np,
        "load": symcheck.load,
        "loads": symcheck.loads,
        "m": symcheck.loads(WALK, "N=3"),
        "WALK": WALK,
        "DIE": DIE,
        "GAME": GAME,
        "s": GAME.check("Pmax=? [ F x=2 ]").strategy,
        "t": GAME.check("Pmax=? [ F<=4 x=2 ]").strategy,
    }
    try:
        shown = repr(eval(cell, names))
    except (symcheck.SymcheckError, TypeError, LookupError, AttributeError) as error:
        last = Path(traceback.extract_tb(error.__traceback__)[-1].filename)
        if last.is_relative_to(PACKAGE) and last.relative_to(PACKAGE).parts[0] in INNER:
            raise
        shown = " ".join(f"{type(error).__name__}: {error}".split())
    assert shown == expected or re.match(expected, shown), shown


@pytest.mark.parametrize("cell", ["m.states[99]", "m.check('x').values[99]", "m.labels['edn']"])
def test_a_wrong_index_shows_one_frame_of_the_library(cell: str) -> None:
    with pytest.raises(LookupError) as caught:
        eval(cell, {"m": symcheck.loads(WALK, "N=3")})
    package = str(Path(symcheck.__file__).parent)
    frames = traceback.extract_tb(caught.value.__traceback__)
    assert sum(f.filename.startswith(package) for f in frames) == 1


def test_there_are_enough_cells() -> None:
    assert len(CELLS) >= 50


def test_an_export_takes_names_and_paths_of_files(tmp_path: Path) -> None:
    model = symcheck.load(DIE)
    assert symcheck.export(model, tmp_path / "die.tra") == [str(tmp_path / "die.tra")]
    with pytest.raises(symcheck.SymcheckError, match="export takes the name of a file"):
        symcheck.export(model, 5)  # type: ignore[arg-type]


def test_a_notebook_shows_one_frame_and_the_message() -> None:
    source = "import symcheck\n\ndef ask(model):\n    return model.check('P=? [ F y=1 ]')\n"
    names: dict[str, object] = {}
    linecache.cache["<cell>"] = (len(source), None, source.splitlines(keepends=True), "<cell>")
    exec(compile(source, "<cell>", "exec"), names)
    with pytest.raises(symcheck.SymcheckError) as caught:
        names["ask"](symcheck.load(DIE))  # type: ignore[operator]
    lines = caught.value._render_traceback_()
    assert lines[0] == "line 4: return model.check('P=? [ F y=1 ]')"
    assert "\n".join(lines[1:]).splitlines()[:2] == [
        "NameFault: <properties>:1:9: error[unknown-name]: unknown name y",
        "  1 | P=? [ F y=1 ]",
    ]


def test_ipython_takes_the_rendered_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    shell = pytest.importorskip("IPython.core.interactiveshell")
    session = shell.InteractiveShell.instance()
    session.run_cell(f"import symcheck; symcheck.load({DIE!r}, engine='sprase')")
    shown = capsys.readouterr().out
    assert "UsageError: engine='sprase': expected one of auto" in shown
    assert "make_options" not in shown
