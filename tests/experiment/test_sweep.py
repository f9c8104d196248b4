"""Sweeps: every instance once, whatever was finished before."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from symcheck.check.bisimulation import on_quotient
from symcheck.experiment.sweep import Instance, check_instance, read_journal, sweep
from symcheck.options import Options

MODEL = """dtmc const int N; const double p; module m s : [0..N] init 0; t : [0..3] init 0;
  [] s<N -> p:(s'=s+1)&(t'=2) + 1-p:(s'=0)&(t'=1); [] s=N -> true; endmodule label "done" = s=N;"""
PROPERTIES = (
    """const int k; "reach": P=? [ F<=k "done" ]; P=? [ F "done" ]; "live": A [ G !"deadlock" ];"""
)
INSTANCE = Instance(MODEL, PROPERTIES, options=Options(engine="explicit"))


def test_an_instance_answers_each_property_for_the_constants_it_needs():
    done = check_instance(
        replace(INSTANCE, constants={"N": "2", "p": "0.5"}, varying={"k": ("2", "3")})
    )
    assert [(r.property, r.constants.get("k")) for r in done.rows] == [
        ("reach", "2"),
        ("reach", "3"),
        ('P=? [ F "done" ]', None),
        ("live", None),
    ]
    assert done.value("reach", k="2") == 0.25
    assert done.value("reach", k="3") == 0.375
    assert done.value("live") == 1
    assert (done.states, done.error) == (4, None)
    assert done.memory > 1_000_000
    with pytest.raises(KeyError):
        done.value("reach", k="7")


def test_reduction_keeps_the_values():
    task = replace(INSTANCE, constants={"N": "2", "p": "0.5"}, varying={"k": ("3",)})
    small = check_instance(replace(task, options=Options(engine="explicit", reduce=True)))
    assert small.states == 3
    assert [r.value for r in small.rows] == [r.value for r in check_instance(task).rows]


def test_properties_of_an_instance_share_a_quotient(monkeypatch):
    asked = []

    def shared_quotient(engine, formulas, options):
        asked.append(len(formulas))
        return made(engine, formulas, options)

    made = on_quotient.shared_quotient
    monkeypatch.setattr(on_quotient, "shared_quotient", shared_quotient)
    task = replace(INSTANCE, constants={"N": "2", "p": "0.5"}, varying={"k": ("2", "3")})
    smaller = check_instance(replace(task, options=Options(engine="explicit", bisim=True)))
    assert asked == [4]
    assert [r.value for r in smaller.rows] == [r.value for r in check_instance(task).rows]


def test_a_faulty_instance_says_why():
    assert "p" in (check_instance(replace(INSTANCE, constants={"N": "2"})).error or "")


def test_a_sweep_is_resumed_from_its_journal(tmp_path):
    journal = tmp_path / "journal.jsonl"
    constants = {"N": ("1", "2"), "p": ("0.5",)}
    first = list(sweep(INSTANCE, constants, varying={"k": ("2",)}, journal=journal))
    assert {d.constants["N"]: d.value("reach", k="2") for d in first} == {"1": 0.75, "2": 0.25}
    assert len(journal.read_text().splitlines()) == 2
    # As after a crash in the middle of a line: what was whole is kept, the rest is done again.
    whole, torn = journal.read_text().splitlines()
    journal.write_text(whole + "\n" + torn[:40])
    again = list(sweep(INSTANCE, constants, varying={"k": ("2",)}, journal=journal))
    assert again[0] == next(d for d in first if d.key == json.loads(whole)["key"])
    assert {d.constants["N"] for d in again} == {"1", "2"}
    assert len(read_journal(journal)) == 2
    more = list(
        sweep(
            INSTANCE,
            {**constants, "N": ("1", "2", "3")},
            varying={"k": ("2",)},
            journal=journal,
            workers=1,
        )
    )
    assert [d.constants["N"] for d in more][-1] == "3"
    assert len(read_journal(journal)) == 3


def test_other_options_are_another_task():
    task = replace(INSTANCE, constants={"N": "2", "p": "0.5"})
    assert task.key == replace(task, constants={"N": "2", "p": "0.5"}).key
    assert task.key != replace(task, options=Options(engine="explicit", epsilon=1e-9)).key
    assert task.key != replace(task, properties="P=? [ F s=1 ]").key
