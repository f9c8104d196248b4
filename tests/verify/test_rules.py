"""What the checker accepts, and the inequality that it names where it does not.

The models are small enough that the values are known: a game that is won or lost, and a choice.
"""

from __future__ import annotations

import copy
import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
import symcheck_verify
from symcheck_verify import Rejected, read_model

from proofs import CHOICE, CLOCK, GAME, certificate, proved, until, vector, written


@pytest.fixture
def game(tmp_path: Path) -> tuple[Path, dict[str, Any]]:
    """The probability 2/3 of winning the game, with its proof."""
    path = written(tmp_path, GAME)
    evidence = {
        "lower": {"vector": vector("2/3", "1", "0"), "ranks": [1, 0, None]},
        "upper": {"vector": vector("2/3", "1", "0")},
    }
    return path, certificate(path, "dtmc", until(None, "2/3", "2/3"), evidence)


def test_a_proved_value_is_accepted(game: tuple[Path, dict[str, Any]]) -> None:
    path, given = game
    assert proved(path, "dtmc", given) == ["state 0: the value is from 2/3 to 2/3"]


def test_a_verdict_follows_from_the_bounds(game: tuple[Path, dict[str, Any]]) -> None:
    path, given = game
    given["statement"]["comparison"] = {"operator": ">=", "threshold": "2/3", "holds": True}
    assert "True: the value is >= 2/3 in each of these states" in proved(path, "dtmc", given)
    given["statement"]["comparison"]["operator"] = ">"
    with pytest.raises(Rejected, match="not what the bounds say"):
        proved(path, "dtmc", given)
    given["statement"]["comparison"]["holds"] = False
    assert "False: the value is > 2/3 in each of these states" in proved(path, "dtmc", given)


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("statement", None),
        ("statement", {"measure": "until", "optimum": None}),
        ("statement", {**until(None, "0", "1"), "right": {"label": "nowhere"}}),
        ("statement", {**until(None, "0", "1"), "bounds": [1]}),
        ("statement", {**until(None, "0", "1"), "bounds": {"0": []}}),
        ("evidence", []),
        ("evidence", {"lower": {}, "upper": {}}),
        ("evidence", {"lower": {"vector": {"numerators": 3, "denominator": "0"}}}),
        ("model", {"sha256": 1}),
    ],
)
def test_what_cannot_be_read_is_rejected(
    game: tuple[Path, dict[str, Any]], part: str, value: object
) -> None:
    path, given = game
    with pytest.raises(Rejected):
        proved(path, "dtmc", {**given, part: value})


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (("lower", "vector"), vector("3/4", "1", "0"), "state 0, choice 0: x <= P x"),
        (("lower", "vector"), vector("2/3", "11/10", "0"), "state 1: x <= 1"),
        (("lower", "vector"), vector("2/3", "1", "1/60"), "state 2: x > 0 needs a rank"),
        (("upper", "vector"), vector("7/12", "1", "0"), "state 0, choice 0: x >= P x"),
        (("upper", "vector"), vector("2/3", "59/60", "0"), "state 1: x >= 1"),
        (("upper", "vector"), vector("2/3", "1", "-1/60"), "state 2: 0 <= x"),
        (("upper", "vector"), vector("2/3", "1", None), "state 0, choice 0: x >= P x"),
        (("lower", "ranks"), [1, 1, None], "no transition lowers the rank 1"),
        (("lower", "ranks"), [1, None, None], "no transition lowers the rank 1"),
        (("lower", "ranks"), [1, 0, 2], "state 2, choice 0: no transition lowers the rank 2"),
        (("lower", "ranks"), [1, 0], "one per state"),
        (("lower", "vector"), vector("7/12", "1", "0"), "not proved to be at least 2/3"),
        (("upper", "vector"), vector("3/4", "1", "0"), "not proved to be at most 2/3"),
        (("lower", "vector"), vector("2/3", "1"), "an integer or null per state"),
    ],
)
def test_what_proves_nothing_is_rejected(
    game: tuple[Path, dict[str, Any]], place: tuple[str, str], value: object, message: str
) -> None:
    path, given = game
    given["evidence"][place[0]][place[1]] = value
    with pytest.raises(Rejected, match=message):
        proved(path, "dtmc", given)


def test_a_certificate_is_about_one_model(game: tuple[Path, dict[str, Any]]) -> None:
    path, given = game
    path.write_text(GAME["tra"].replace("1/3", "1/4").replace("1/6", "1/4"))
    with pytest.raises(Rejected, match=r"about another model: \.tra differ"):
        proved(path, "dtmc", given)


def test_rounded_decimals_are_no_distribution(tmp_path: Path) -> None:
    path = written(tmp_path, {**GAME, "tra": GAME["tra"].replace("1/3", "0.33333")})
    with pytest.raises(Rejected, match="do not sum to 1"):
        read_model(path, "dtmc", "rational")


def test_doubles_are_what_they_are(tmp_path: Path) -> None:
    path = written(tmp_path, {**GAME, "tra": "2 3\n0 0 0.1\n0 1 0.9\n1 1 1\n"})
    read_model(path, "dtmc", "rational")
    with pytest.raises(Rejected, match="do not sum to 1"):
        read_model(path, "dtmc", "double")  # the nearest doubles do not sum to 1


@pytest.fixture
def choice(tmp_path: Path) -> Path:
    return written(tmp_path, CHOICE)


GREATEST = {
    "lower": {
        "vector": vector("1/2", "1", "0"),
        "choices": [1, 0, 0],
        "ranks": [1, 0, None],
    },
    "upper": {"vector": vector("1/2", "1", "0")},
}


def test_a_greatest_probability_needs_a_strategy_that_leaves(choice: Path) -> None:
    given = certificate(choice, "mdp", until("max", "1/2", "1/2"), copy.deepcopy(GREATEST))
    assert proved(choice, "mdp", given)
    given["evidence"]["lower"]["choices"][0] = 0  # x <= P x holds, but the run stays for ever
    with pytest.raises(Rejected, match="state 0, choice 0: no transition lowers the rank 1"):
        proved(choice, "mdp", given)


def test_a_least_probability_has_ranks_for_all_choices(choice: Path) -> None:
    evidence = {
        "lower": {"vector": vector("0", "1", "0"), "ranks": [None, 0, None]},
        "upper": {"vector": vector("0", "1", "0"), "choices": [0, 0, 0]},
    }
    given = certificate(choice, "mdp", until("min", "0", "0"), evidence)
    assert proved(choice, "mdp", given)
    given["evidence"]["lower"] = {"vector": vector("1/2", "1", "0"), "ranks": [1, 0, None]}
    with pytest.raises(Rejected, match="state 0, choice 0: no transition lowers the rank 1"):
        proved(choice, "mdp", given)
    given["statement"]["optimum"] = None
    with pytest.raises(Rejected, match="an mdp needs the optimum"):
        proved(choice, "mdp", given)


def test_rewards_are_finite_where_ranks_descend(tmp_path: Path) -> None:
    path = written(tmp_path, {**GAME, "tra": "3 4\n0 0 1/2\n0 1 1/2\n1 1 1\n2 2 1\n"})
    statement = {
        "measure": "reward", "reward": "r", "target": {"label": "won"}, "optimum": None,
        "bounds": {"0": ["6", "6"], "2": ["Infinity", "Infinity"]},
    }  # fmt: skip
    evidence = {
        "lower": {
            "vector": vector("6", "0", None),
            "missed": {"vector": vector("1", "1", "0")},
        },
        "upper": {"vector": vector("6", "0", None), "ranks": [1, 0, None]},
    }
    given = certificate(path, "dtmc", statement, evidence)
    assert len(proved(path, "dtmc", given)) == 2
    given["evidence"]["lower"]["missed"]["vector"] = vector("1", "1", "1")
    with pytest.raises(Rejected, match="state 2: it is not proved that the target may be missed"):
        proved(path, "dtmc", given)
    given["evidence"]["upper"]["vector"] = vector("6", "0", "0")
    given["statement"]["bounds"] = {"2": ["0", "0"]}
    with pytest.raises(Rejected):
        proved(path, "dtmc", given)


def test_a_state_of_finite_reward_does_not_enter_one_of_infinite_reward(tmp_path: Path) -> None:
    path = written(tmp_path, GAME)
    statement = {
        "measure": "reward", "reward": "r", "target": {"label": "won"}, "optimum": None,
        "bounds": {"0": ["0", "6"]},
    }  # fmt: skip
    evidence = {
        "lower": {"vector": vector("0", "0", "0")},
        "upper": {"vector": vector("6", "0", None), "ranks": [1, 0, None]},
    }
    with pytest.raises(Rejected, match=r"state 0, choice 0: x >= r \+ P x"):
        proved(path, "dtmc", certificate(path, "dtmc", statement, evidence))


def test_averages_have_a_gain_and_a_bias(tmp_path: Path) -> None:
    path = written(tmp_path, CLOCK)  # 3/4 of the time in 0, where 8 is earned per unit of time
    statement = {"measure": "average", "reward": "r", "optimum": None, "bounds": {"0": ["6", "6"]}}
    side = {"gain": vector("6", "6"), "bias": vector("1", "0")}
    given = certificate(path, "ctmc", statement, {"lower": side, "upper": side})
    assert proved(path, "ctmc", given)
    given["evidence"]["upper"] = {"gain": vector("6", "6"), "bias": vector("2", "0")}
    with pytest.raises(Rejected, match=r"state 1, choice 0: t g \+ h >= r \+ P h"):
        proved(path, "ctmc", given)
    given["evidence"]["upper"] = {"gain": vector("6", "7"), "bias": vector("1", "0")}
    with pytest.raises(Rejected, match="state 0, choice 0: g >= P g"):
        proved(path, "ctmc", given)


def test_steps_are_repeated(choice: Path) -> None:
    """No evidence is needed: choice 1 wins in the first step."""
    for optimum, steps, value in (("max", 0, "0"), ("max", 1, "1/2"), ("min", 9, "0")):
        given = certificate(choice, "mdp", until(optimum, value, value, steps=steps), {})
        assert proved(choice, "mdp", given)
    given = certificate(choice, "mdp", until("max", "1/2", "0.499", steps=3), {})
    with pytest.raises(Rejected, match="not proved to be at most"):
        proved(choice, "mdp", given)
    statement = {"measure": "cumulative", "reward": "r", "steps": 5, "optimum": "max"}
    given = certificate(choice, "mdp", {**statement, "bounds": {"0": ["5", "5"]}}, {})
    assert proved(choice, "mdp", given)
    given["statement"]["factor"] = "-1"  # the best of two steps would not be that of each
    with pytest.raises(Rejected, match="at least 0"):
        proved(choice, "mdp", given)
    statement = {"measure": "instantaneous", "reward": "r", "steps": 5, "optimum": "min"}
    given = certificate(choice, "mdp", {**statement, "bounds": {"0": ["0", "0"]}}, {})
    assert proved(choice, "mdp", given)


def test_steps_that_change_nothing_are_not_repeated(choice: Path) -> None:
    given = certificate(choice, "mdp", until("max", "1/2", "1/2", steps=10**15), {})
    assert proved(choice, "mdp", given)


@pytest.mark.parametrize(
    ("time", "low", "high"),
    [  # 1 - exp(-2 time)
        ("0", "0", "0"),
        ("1/2", "0.632120558828557678404", "0.632120558828557678405"),
        ("20", "0.99999999999999999575164", "0.99999999999999999575165"),
        ("1e-9", "1.9999999980000000e-9", "1.9999999980000001e-9"),
    ],
)
def test_time_is_uniformised(tmp_path: Path, time: str, low: str, high: str) -> None:
    path = written(tmp_path, CLOCK)
    given = certificate(path, "ctmc", until(None, low, high, time=time), {})
    assert proved(path, "ctmc", given)
    given["statement"]["bounds"]["0"] = [str(Fraction(high) + Fraction(1, 10**18)), "1"]
    with pytest.raises(Rejected, match="not proved to be at least"):
        proved(path, "ctmc", given)


def test_the_complement_has_the_complementary_bounds(game: tuple[Path, dict[str, Any]]) -> None:
    path, given = game
    given["statement"] |= {"negated": True, "bounds": {"0": ["1/3", "1/3"]}}
    assert proved(path, "dtmc", given)


def test_the_command_says_what_is_proved(
    game: tuple[Path, dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, given = game
    file = tmp_path / "proof.json"
    file.write_text(json.dumps(given))
    assert symcheck_verify.main([str(path), str(file)]) == 0
    assert capsys.readouterr().out.startswith('accepted: {"measure": "until", "left": "all"')
    given["evidence"]["upper"]["vector"] = vector("7/12", "1", "0")
    file.write_text(json.dumps(given))
    assert symcheck_verify.main([str(path), str(file)]) == 1
    assert capsys.readouterr().out == "rejected: state 0, choice 0: x >= P x does not hold\n"
    file.write_text("{}")
    assert symcheck_verify.main([str(path), str(file)]) == 1
    assert symcheck_verify.main([]) == 2


def test_keys_that_no_rule_reads_are_rejected(game: tuple[Path, dict[str, Any]]) -> None:
    """The checker prints the statement: what it prints has to be what it proved."""
    path, given = game
    for key, value in (("steps", None), ("reward", "r"), ("lower", 3), ("negated", "false")):
        changed = copy.deepcopy(given)
        changed["statement"][key] = value
        with pytest.raises(Rejected, match=r"whole number of steps|no measure that is known"):
            proved(path, "dtmc", changed)


@pytest.mark.parametrize(
    "states",
    [
        {"states": ["1"]},
        {"states": [1.0]},
        {"states": [True]},
        {"states": "1"},
        {"states": [1, 99]},
        {"states": [-2]},
        {"states": [1], "not": "all"},
        {"label": "won", "states": []},
        "won",
    ],
)
def test_a_set_of_states_is_what_it_looks_like(
    game: tuple[Path, dict[str, Any]], states: object
) -> None:
    """The text "1" is no state: such a set would be empty, and would read as if it were not."""
    path, given = game
    given["statement"]["right"] = {"or": [{"label": "won"}, states]}
    with pytest.raises(Rejected, match="unknown set of states"):
        proved(path, "dtmc", given)


@pytest.mark.parametrize(
    "number", [0.5, True, None, "nan", "1_0", "１", "1e99999999", " 1/2", "1/2\naccepted"]
)
def test_numbers_of_a_statement_are_texts(
    game: tuple[Path, dict[str, Any]], number: object
) -> None:
    """0.1 would be shown as 1/10, and is another number."""
    path, given = game
    given["statement"]["bounds"]["0"][0] = number
    with pytest.raises(Rejected, match="not the text of a number"):
        proved(path, "dtmc", given)


@pytest.mark.parametrize(
    ("kind", "transitions"),
    [
        (
            "dtmc",
            "2 2 2\n0 0 1 1\n1 1 1 1\n",
        ),  # an mdp: as a chain, each state would lead to 0 or 1
        ("dtmc", "2\n0 0 1\n1 1 1\n"),
        ("mdp", "2 3 2\n0 0 0 1\n1 0 1 1\n"),
        ("mdp", "2 2 2\n0 -1 0 1\n1 0 1 1\n"),
        ("mdp", "2 2 2\n0 0 0 1\n1 1 1 1\n"),
        ("dtmc", "99999999999999 1\n99999999999998 0 1\n"),  # this would fill the memory
        ("dtmc", "2 2\n0 0 nan\n1 1 1\n"),
        ("dtmc", "2 2\n0 0 1e999999999\n1 1 1\n"),
        ("dtmc", "2 3\n0 0 2\n0 1 -1\n1 1 1\n"),
    ],
)
def test_files_of_other_models_are_rejected(tmp_path: Path, kind: str, transitions: str) -> None:
    path = written(tmp_path, {"tra": transitions, "srew": "2 0\n"})
    with pytest.raises(Rejected):
        read_model(path, kind, "rational")


@pytest.mark.parametrize(
    ("suffix", "text"),
    [
        ("srew", "3 1\n0 1 3\n"),
        ("srew", "3 2\n0 3\n0 3\n"),
        ("srew", "3 1\n7 3\n"),
        ("trew", "3 1\n-3 0 3\n"),
        ("trew", "3 2\n0 1 3\n0 1 3\n"),
        ("trew", "3 1\n0 0 1 3\n"),
    ],
)
def test_rewards_have_the_places_of_the_model(tmp_path: Path, suffix: str, text: str) -> None:
    path = written(tmp_path, GAME)
    path.with_suffix(f".{suffix}").write_text(text)
    with pytest.raises(Rejected, match="no such place"):
        read_model(path, "dtmc", "rational")


def test_rewards_of_another_certificate_do_not_count(tmp_path: Path) -> None:
    """m1.srew may be the second structure of m, or the first one of another certificate m1."""
    path = written(tmp_path, GAME)
    rewards = '# Reward structure "r"\n# Transition rewards\n3 1\n0 1 3\n'
    path.with_suffix(".trew").write_text(rewards)
    digests = read_model(path, "dtmc", "rational").digests
    (tmp_path / "m1.trew").write_text(rewards)  # the same: it would count twice
    (tmp_path / "m1.srew").write_text('# Reward structure "r"\n3 1\n0 5\n')
    model = read_model(path, "dtmc", "rational", digests.values())
    assert model.rewards["r"] == ({0: 3}, {(0, 1): 3}, {0: 1})
    assert model.digests == digests
    with pytest.raises(Rejected, match=r"two files beside the model are \.srew r"):
        read_model(path, "dtmc", "rational")


def test_each_file_of_the_model_has_a_digest(game: tuple[Path, dict[str, Any]]) -> None:
    path, given = game
    del given["model"]["sha256"][".lab"]
    with pytest.raises(Rejected, match=r"about another model: \.lab differ"):
        proved(path, "dtmc", given)


@pytest.mark.parametrize(
    "text",
    ["", "[" * 100_000, "[]", "{}", "NaN", '{"model": 1}', '"\\ud800"', "\0"],
)
def test_whatever_is_no_certificate_is_rejected(
    game: tuple[Path, dict[str, Any]], tmp_path: Path, text: str
) -> None:
    path, given = game
    file = tmp_path / "proof.json"
    file.write_text(text)
    assert symcheck_verify.main([str(path), str(file)]) == 1
    file.write_text(json.dumps(given))
    path.write_text("")
    assert symcheck_verify.main([str(path), str(file)]) == 1
    assert symcheck_verify.main([str(tmp_path), str(file)]) == 1


def test_no_text_of_a_certificate_looks_like_a_verdict(
    game: tuple[Path, dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, given = game
    file = tmp_path / "proof.json"
    given["property"] = "x\naccepted: \ud800"
    file.write_text(json.dumps(given))
    assert symcheck_verify.main([str(path), str(file)]) == 0
    assert capsys.readouterr().out.count("\naccepted") == 0
    given["statement"]["measure"] = "x\naccepted: \ud800"
    file.write_text(json.dumps(given))
    assert symcheck_verify.main([str(path), str(file)]) == 1
    assert capsys.readouterr().out.count("\naccepted") == 0
    del given["property"]
    given["statement"]["measure"] = "until"
    file.write_text(json.dumps(given))
    assert symcheck_verify.main([str(path), str(file)]) == 1
    assert "accepted" not in capsys.readouterr().out


def test_the_checker_is_short_and_imports_the_standard_library_only() -> None:
    import sys

    text = Path(symcheck_verify.__file__).read_text()
    assert len(text.splitlines()) <= 610
    imported = [line.split()[1].split(".")[0] for line in text.splitlines()
                if line.startswith(("import ", "from "))]  # fmt: skip
    assert set(imported) <= sys.stdlib_module_names
