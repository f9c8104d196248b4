"""A search that ends early names the variables without bounds that grow, how far they came, and what to do."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import MemoryLimitError, TimeLimitError, UnsupportedError

GROWING = """ctmc
module queue
  count : int init 0;
  kept : int init 5;
  below : int init 0;
  y : [0..3] init 0;
  [] true -> 1:(count'=count+1)&(below'=max(-9,below-1));
  [] count>0 -> 2:(count'=count-1)&(y'=mod(y+1,4));
endmodule
"""
ENDLESS = "ctmc module m x : [0..100000000]; [] x<100000000 -> 1:(x'=x+1); endmodule"
PROPERTY = "P=? [ F count=3 ]"
NEVER = "T=? [ F count<0 ]"
"""Every state is before this target."""


@pytest.mark.parametrize("options", [{"engine": "auto"}, {"engine": "explicit"}, {"exact": True}])
def test_the_message_names_the_variables_and_what_they_have_reached(
    options: dict[str, object],
) -> None:
    model = symcheck.loads(GROWING, max_memory=4 << 20, **options)  # type: ignore[arg-type]
    with pytest.raises(MemoryLimitError) as stopped:
        model.check(NEVER)
    message = str(stopped.value)
    found = re.search(r"count \(<model>:3:3\) has no bounds, and has reached 0\.\.(\d+)", message)
    assert found is not None, message
    assert int(found[1]) > 50
    assert "; below (<model>:5:3) has no bounds, and has reached -9..0" in message
    assert "kept" not in message
    assert "hint: give count a range, as in count : [0..100]" in message
    assert "-nostates" in message
    assert "-h and -m" not in message


@pytest.mark.parametrize("options", [{"engine": "auto"}, {"engine": "explicit"}, {"exact": True}])
def test_what_the_message_advises_helps(options: dict[str, object]) -> None:
    stopping = symcheck.loads(GROWING, stop_at_targets=True, **options)  # type: ignore[arg-type]
    bounded = symcheck.loads(
        GROWING.replace("count : int", "count : [0..60]").replace("true ->", "count<60 ->")
    )
    formula = "P=? [ true U count=3 ]" if "exact" in options else PROPERTY
    assert float(stopping.check(formula)) == pytest.approx(float(bounded.check(formula)), rel=1e-5)


@pytest.mark.parametrize("engine", ["sparse", "hybrid", "mtbdd"])
def test_diagrams_name_the_variable_and_its_place(engine: str) -> None:
    with pytest.raises(UnsupportedError, match=r"variable count has no bounds \(<model>:3:3\)"):
        symcheck.loads(GROWING, engine=engine).check(PROPERTY)  # type: ignore[arg-type]


def test_a_time_limit_names_it_too() -> None:
    with pytest.raises(TimeLimitError, match=r"(?s)count .* has reached"):
        symcheck.loads(GROWING, engine="explicit", time_limit=3).check(NEVER)


@pytest.mark.parametrize("engine", ["-ex", "-exact"])
def test_a_run_that_is_stopped_names_it(
    engine: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "m.sm").write_text(GROWING)
    assert main([str(tmp_path / "m.sm"), "-pf", NEVER, engine, "-timeout", "8"]) == 3
    assert "m.sm:3:3) has no bounds, and has reached 0.." in capfd.readouterr().err


def test_the_limit_of_the_process_names_it(tmp_path: Path) -> None:
    """Memory ends by itself, before the limit that is taken from what is free on the machine."""
    (tmp_path / "m.sm").write_text(GROWING)
    words = f"exec {sys.executable} -m symcheck {tmp_path}/m.sm -pf '{NEVER}' -ex"
    run = subprocess.run(
        ["bash", "-c", f"ulimit -v 1200000; {words}"], capture_output=True, text=True, timeout=300
    )
    assert run.returncode == 3
    assert "count" in run.stderr
    assert "has reached 0.." in run.stderr


def test_variables_with_bounds_are_not_blamed() -> None:
    with pytest.raises(MemoryLimitError) as stopped:
        symcheck.loads(ENDLESS, engine="explicit", max_memory=4 << 20).check("P=? [ F<=1 x=3 ]")
    assert "has no bounds" not in str(stopped.value)
    assert "the engines -h and -m need less" in str(stopped.value)
