"""Paths as text, and the switches that ask for them."""

from __future__ import annotations

from pathlib import Path as File

import pytest

from symcheck.api.loading import loads
from symcheck.cli.entry_point import run_safely
from symcheck.cli.simulation.path_options import parse_path_options
from symcheck.errors import NameFault, UsageError
from symcheck.semantics.binding.bind import bind
from symcheck.simulate.path import PathFormat, rows, table
from symcheck.simulate.stepper import simulate
from symcheck.simulate.steps import CommandSuccessors
from symcheck.syntax.parse import parse_model

COUNTER = """dtmc
module counter
  x : [0..3]; b : bool;
  [up] x<3 -> (x'=x+1);
  [] x=3 & !b -> (b'=true);
endmodule
rewards x<3 : x; [up] true : 2; endrewards
"""
CLOCK = "ctmc module ticker x:[0..1]; [] true -> 2:(x'=1-x); endmodule"


def model(text: str = COUNTER) -> CommandSuccessors:
    return CommandSuccessors(bind(parse_model(text), {}))


def test_table() -> None:
    text = table(simulate(model(), 10, seed=1))
    assert (
        text
        == "action step x b\n- 0 0 false\n[up] 1 1 false\n[up] 2 2 false\n[up] 3 3 false\ncounter 4 3 true\n"
    )


def test_probabilities_and_rewards() -> None:
    found = rows(simulate(model(), 2, seed=1), PathFormat(probabilities=True, rewards=True))
    assert found[0] == [
        "action",
        "probability",
        "step",
        "x",
        "b",
        "state_reward1",
        "transition_reward1",
    ]
    assert found[2] == ["[up]", "1.0", "1", "1", "false", "1.0", "2.0"]


def test_chosen_variables_show_changes_only() -> None:
    layout = parse_path_options("10,vars=(b),sep=comma").path_format
    assert (
        table(simulate(model(), 10, seed=1), layout) == "action,step,b\n-,0,false\ncounter,4,true\n"
    )
    layout = parse_path_options("10,vars=(b),changes=false").path_format
    assert len(rows(simulate(model(), 10, seed=1), layout)) == 6


def test_snapshots() -> None:
    path = simulate(model(CLOCK), time=4, seed=1, loop_check=False)
    found = rows(path, PathFormat(snapshot=0.5))
    assert found[0] == ["step", "time", "x"]
    assert [r[1] for r in found[1:9]] == [str(0.5 * i) for i in range(8)]
    for step, time, x in found[1:]:
        assert path[int(step)].time <= float(time)
        assert int(step) == len(path) or path[int(step) + 1].time > float(time)
        assert str(path[int(step)].state[0]) == x


def test_ends() -> None:
    assert simulate(model(), 10).end == "deadlock"
    assert simulate(model(), 3).end == "steps"
    assert simulate(model(), max_steps=2).end == "length"
    timed = simulate(model(CLOCK), time=5, seed=1, loop_check=False)
    assert timed.end == "time"
    assert timed.times[-2] < 5 <= timed.times[-1]
    circle = model(
        "dtmc module m x:[0..3]; [] x=0 -> 0.5:(x'=1)+0.5:(x'=2); [] x>0 -> (x'=mod(x,3)+1); endmodule"
    )
    path = simulate(circle, 100, seed=1)
    assert path.end == "loop"
    assert len(path) == 4
    assert path.steps[1].state == path.steps[4].state
    assert len(simulate(circle, 100, seed=1, loop_check=False)) == 100


def test_values_of_unknown_variables() -> None:
    path = simulate(model(), 3, seed=1)
    assert path.values("x") == [0, 1, 2, 3]
    with pytest.raises(NameFault, match="the model has x, b"):
        path.values("y")


UNCLEAR = [
    "",
    "vars=(x)",
    "10,time=3",
    "10,sep=dot",
    "10,rewards=yes",
    "time=soon",
    "10,snapshot=0",
    "10,colour=red",
]


@pytest.mark.parametrize("text", UNCLEAR)
def test_requests_that_are_not_understood(text: str) -> None:
    with pytest.raises(UsageError, match=r"needs|must|unknown") as error:
        parse_path_options(text)
    assert "-simpath" not in str(error.value)


def test_requests() -> None:
    request = parse_path_options("deadlock,repeat=7,loopcheck=false,vars=(x,b),sep=tab")
    assert (request.deadlock, request.repeat, request.loop_check) == (True, 7, False)
    assert request.path_format == PathFormat(variables=("x", "b"), separator="\t", changes=True)


def test_command_line(tmp_path: File, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = tmp_path / "m.pm", tmp_path / "path.txt"
    file.write_text(COUNTER)
    assert run_safely([str(file), "-simpath", "10", str(out), "-seed", "1"]) == 0
    assert out.read_text().startswith("action step x b\n- 0 0 false\n")
    assert run_safely([str(file), "-simpath", "deadlock", "stdout"]) == 0
    assert "counter 4 3 true" in capsys.readouterr().out
    assert (
        run_safely([str(file), "-pf", "P=? [ F<=4 b ]", "-sim", "-simsamples", "100", "-seed", "7"])
        == 0
    )
    shown = capsys.readouterr().out
    assert "Result: 1.0 (in [0.948396, 1]" in shown
    assert "seed 7" in shown
    assert run_safely([str(file), "-pf", "S=? [ b ]", "-sim"]) == 1
    assert run_safely([str(file), "-pf", "P=? [ F b ]", "-sim", "-simmethod", "guess"]) == 2
    assert "sprt" in capsys.readouterr().err
    assert run_safely([str(file), "-pf", "P=? [ F b ]", "-sim", "-steadystate"]) == 2


def test_library() -> None:
    loaded = loads(COUNTER)
    path = loaded.simulate(10, seed=1)
    assert str(path).splitlines()[-1] == "counter 4 3 true"
    assert "<td>counter</td>" in path._repr_html_()
    assert (path[-1]["x"], path[-1]["b"]) == path[-1].state == (3, True)
    with pytest.raises(KeyError, match="there are x, b"):
        path[-1]["unknown"]
    assert loaded.estimate("P=? [ F<=4 b ]", samples=50, seed=1).value == 1.0
