"""Cells with models and properties, as a notebook runs them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

DOCS = Path(__file__).resolve().parents[2] / "docs" / "notebooks.md"
WALK = """dtmc
const int N;
module m // <a> walk
  x : [0..N] init 1;
  [] x>0 & x<N -> 0.5 : (x'=x-1) + 0.5 : (x'=x+1);
  [] x=0 | x=N -> true;
endmodule
label "won" = x=N;"""


def ran(*sources: str) -> list[list[Any]]:
    """What the cells of a notebook show, after the line that loads the extension."""
    cells = [nbformat.v4.new_code_cell(s) for s in ("%load_ext symcheck.notebook", *sources)]
    notebook = nbformat.v4.new_notebook(cells=cells)
    NotebookClient(notebook, timeout=120, allow_errors=True).execute()
    return [cell.outputs for cell in notebook.cells[1:]]


def error_of(outputs: list[Any]) -> str:
    (fault,) = [o for o in outputs if o.output_type == "error"]
    return "\n".join(fault.traceback)


def html(outputs: list[Any]) -> str:
    return "".join(o.data.get("text/html", "") for o in outputs if "data" in o)


def test_a_model_and_its_properties() -> None:
    model, checked, value, table = ran(
        f"%%prism walk N=3\n{WALK}",
        '%%pctl walk -r found\n"win": P=? [ F "won" ];\nP>0.5 [ F "won" ]',
        "print(round(float(found[0]), 9), found['win'] is found[0], len(found), found)",
        "%%pctl walk k=1:3\nconst int k;\nP=? [ F<=k x=3 ]",
    )
    assert "walk: dtmc" in html(model)
    assert "// &lt;a&gt; walk" in html(model)
    shown = html(checked)
    assert "&quot;win&quot;: P=? [ F &quot;won&quot; ]" in shown
    assert "0.33333333333333" in shown
    assert "<td>false</td>" in shown
    text = "".join(o.text for o in value if o.output_type == "stream" and o.name == "stdout")
    assert text.startswith("0.333333333 True 2 property")
    assert html(table).count("<tr>") == 4


def test_faults_are_told_with_the_line_of_the_cell_and_without_a_traceback() -> None:
    syntax, name, late, option = ran(
        "%%prism bad\ndtmc\nmodule m\n x:[0..3] init 1\n [] x>0 -> true;\nendmodule",
        "%%pctl bad\nP=? [ F x=1 ]",
        f"%%prism walk N=3 -o engin=sparse\n{WALK}",
        f"%%prism walk N=3 -o max_iters=many\n{WALK}",
    )
    assert error_of(syntax).startswith("bad:4:16: error[missing]: ';' is missing")
    assert error_of(name) == "bad is no model\n  hint: %%prism NAME makes one"
    assert "there is no option 'engin' (did you mean 'engine'?)" in error_of(late)
    assert "max_iters" in error_of(option)
    assert "Traceback" not in "".join(map(error_of, (syntax, name, late, option)))


def test_finished_results_are_shown_if_a_property_fails() -> None:
    _, checked = ran(f"%%prism walk N=3\n{WALK}", '%%pctl walk\nP=? [ F "won" ];\nR=? [ F x=0 ]')
    assert "0.33333333333333" in html(checked)
    assert "the model has no reward structure" in error_of(checked)


def test_constants_may_stay_open_until_a_property_is_checked() -> None:
    model, checked = ran(f"%%prism walk\n{WALK}", '%%pctl walk N=2:4\nP=? [ F "won" ]')
    assert "walk, with open constants: N" in html(model)
    assert all(value in html(checked) for value in ("0.5", "0.33333333333333", "0.25"))


def test_options_reach_the_model_and_the_properties(shell) -> None:
    shell.run_cell_magic("prism", "walk N=3 -o engine=sparse", WALK)
    assert shell.user_ns["walk"].options.engine == "sparse"
    found = shell.run_cell_magic("pctl", "walk -o engine=exact", 'P=? [ F "won" ]')
    assert str(found[0].value) == "1/3"


def test_an_interrupt_keeps_what_is_finished(shell, monkeypatch) -> None:
    from symcheck.api.progress import Reporter

    shell.run_cell_magic("prism", "walk N=3", WALK)
    said: list[str] = []

    def say(reporter: Reporter, text: str) -> None:
        said.append(text)
        if text.startswith("2 of 2"):
            raise KeyboardInterrupt

    monkeypatch.setattr("symcheck.notebook.cells.Reporter", lambda _: _Telling(say))
    with pytest.raises(Exception, match="interrupted after 1 property"):
        shell.run_cell_magic("pctl", "walk", 'P=? [ F "won" ];\nP=? [ F x=0 ]')
    assert said[0].startswith("1 of 2")


class _Telling:
    def __init__(self, say) -> None:
        self._say = say

    def say(self, text: str) -> None:
        self._say(self, text)

    def __call__(self, event: object) -> None: ...

    def iteration(self, event: object) -> None: ...


def test_the_page_about_notebooks_runs() -> None:
    blocks = re.findall(r"^```ipython\n(.*?)^```", DOCS.read_text(), re.MULTILINE | re.DOTALL)
    outputs = ran(*blocks)
    assert not [error_of(o) for o in outputs if any(p.output_type == "error" for p in o)]
    texts = [o.data.get("text/plain", "") for cell in outputs for o in cell if "data" in o]
    # Gambler's ruin from 1 with odds 3:2 against: (1-r)/(1-r^4) for r=3/2 is 8/65.
    assert "[0.123077, True]" in texts
    assert "6" in texts


def test_open_constants_take_single_values_and_what_is_missing_is_said() -> None:
    _, checked, missing = ran(
        f"%%prism walk\n{WALK}",
        '%%pctl walk N=4,k=3\nconst int k;\nP=? [ F "won" ];\nP=? [ F<=k "won" ]',
        '%%pctl walk\nP=? [ F "won" ]',
    )
    assert "<td>0.125</td>" in html(checked)
    assert "write its value behind %%pctl walk, as in N=4,p=0.5" in error_of(missing)


def test_a_faulty_property_does_not_stop_the_others() -> None:
    _, checked = ran(
        f"%%prism walk N=4\n{WALK}",
        '%%pctl walk\nP=? [ F "wno" ];\nP=? [ F "won" ];\nP=? [ F x=9+y ]',
    )
    assert html(checked).count("<tr>") == 2
    assert 'there is no label "wno"' in error_of(checked) or "wno" in error_of(checked)
    assert "unknown name y" in error_of(checked)


def test_warnings_of_states_are_shown() -> None:
    _, checked = ran(
        "%%prism m\ndtmc module m x:[0..3]; [] x<3->(x'=x+1); [] x<2->(x'=0); endmodule",
        "%%pctl m\nP=? [ F x=3 ]",
    )
    assert "a fair coin decides" in html(checked)
    assert "deadlocks were given self-loops in 1 state, such as (x=3)" in html(checked)


def test_warnings_of_a_model_are_shown_once_its_constants_have_values() -> None:
    model, unused, again = ran(
        "%%prism m\nmdp const int N; module m x:[0..3]; [] x>N->(x'=0); [] x<=3->true; endmodule",
        "%%pctl m N=5\nPmax=? [ F x=3 ]",
        "%%pctl m N=2\nPmax=? [ F x=3 ]",
    )
    assert "guard" not in html(model)
    assert "guard" in html(unused)
    assert "guard" not in html(again)


def test_results_of_a_run_before_are_no_results_of_this_one() -> None:
    commands = "[] x=0 -> p:(x'=1)+1-p:(x'=2); [] x>0 -> true;"
    model = f"dtmc const double p; module m x:[0..2]; {commands} endmodule"
    values = "print([round(float(v), 9) for v in found])"
    _, _, first, _, _, second, _, third = ran(
        f"%%prism m p=0.3\n{model}",
        "%%pctl m -r found\nP=? [ F x=1 ];\nP=? [ F x=2 ]",
        values,
        f"%%prism m p=0.9\n{model}",
        "%%pctl m -r found\nP=? [ F x=1 ];\nP=? [ F y=2 ]",
        values,
        "%%pctl m -r found\nP=? [ F y=2 ]",
        values,
    )
    assert first[0].text == "[0.3, 0.7]\n"
    assert second[0].text == "[0.9]\n"
    assert "NameError" in error_of(third)


@pytest.mark.parametrize(
    ("name", "why", "better"),
    [
        ("3x", "is no name in Python", "_3x"),
        ("class", "is a word of Python", "class_"),
        ("my-walk", "is no name in Python", "my_walk"),
    ],
)
def test_a_variable_has_a_name_that_python_reads(
    shell: Any, name: str, why: str, better: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for magic, line in (("prism", f"{name} N=3"), ("pctl", f"walk -r {name}")):
        shell.run_cell(f"%%prism walk N=3\n{WALK}").raise_error()
        shown = shell.run_cell(f"%%{magic} {line}\n{WALK if magic == 'prism' else 'P=? [ F x=3 ]'}")
        wanted = f"'{name}' {why}\n  hint: choose another name, such as {better}"
        assert str(shown.error_in_exec) == wanted
        assert name not in shell.user_ns
    assert "Traceback" not in capsys.readouterr().out
