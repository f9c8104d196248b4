"""Bounds on rewards: against models that count the reward in a variable, against Storm, and by hand."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from symcheck.engines.registry import BUILDERS
from symcheck.errors import InputError, UnsupportedError

SLOW = settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))

CHAIN = """dtmc
const double u = 1;
module m
  s : [0..3];
  [a] s=0 -> 0.5:(s'=1) + 0.5:(s'=0);
  [b] s=1 -> 0.5:(s'=2) + 0.5:(s'=1);
  [c] s=2 -> (s'=3);
  [] s=3 -> true;
endmodule
rewards "x" s=0 : u; s=1 : 2*u; s=2 : 3*u; s=3 : 5*u; endrewards
rewards "y" [a] true : 1; [b] true : 1; [c] true : 2; endrewards
"""


def ask(text, model=CHAIN, engine="explicit", u="1"):
    return check_text(engine_of(model.replace("u = 1", f"u = {u}"), engine), text).value


@pytest.mark.parametrize("engine", list(BUILDERS))
def test_what_is_counted(engine):
    # The state that is reached is not paid for, the step into it is. Storm has the same values.
    values = {k: ask(f'P=? [ F^{{rew{{"x"}}<={k}}} s=2 ]', engine=engine) for k in (2, 3, 4)}
    assert values == {2: 0, 3: pytest.approx(0.25, rel=1e-12), 4: pytest.approx(0.375, rel=1e-12)}
    assert ask('P=? [ F{"y"}<=2 s=2 ]', engine=engine) == pytest.approx(0.25, rel=1e-12)
    assert ask('P=? [ F{"x"}>3 s=2 ]', engine=engine) == pytest.approx(0.75, rel=1e-12)
    assert ask('P=? [ F{"x"}<=3,{"y"}<=2 s=2 ]', engine=engine) == pytest.approx(0.25, rel=1e-12)
    # Long after s=3 was reached first, it still holds.
    assert ask('P=? [ F{"x"}>=100 s=3 ]', engine=engine) == 1


@pytest.mark.parametrize("engine", ["explicit", "exact"])
def test_a_bound_from_below_that_is_greater_than_one_from_above(engine):
    # At least three steps in s=0, so twice no luck; then to s=2, and not to s=3.
    model = """dtmc
    module m
      s : [0..3];
      [] s=0 -> 0.5:(s'=1) + 0.5:(s'=0);
      [] s=1 -> 0.75:(s'=2) + 0.25:(s'=3);
      [] s>1 -> true;
    endmodule
    rewards "x" s=0 : 1; endrewards
    rewards "y" s=1 : 1; endrewards
    """
    assert ask('P=? [ F{"x"}>=3,{"y"}<=1 s=2 ]', model, engine) == pytest.approx(
        0.25 * 0.75, rel=1e-12
    )


def test_operators():
    within = ask('P=? [ F{"x"}<=4 s>=2 ]')
    assert ask('P=? [ G{"x"}<=4 s<2 ]') == pytest.approx(1 - within)
    assert ask('P=? [ s<2 W{"x"}<=4 s>5 ]') == pytest.approx(1 - within)
    assert ask('P=? [ s>5 R{"x"}<=4 s<2 ]') == pytest.approx(1 - within)
    assert ask('P=? [ s=0 U{"x"}<=4 s=1 ]') == pytest.approx(15 / 16)
    assert ask('P=? [ X{"x"}<=1 s=1 ]') == 0.5
    assert ask('P=? [ X{"x"}<1 s=1 ]') == 0
    assert ask('P=? [ X{"x"}[1,2] true ]') == 1
    assert ask('P>=0.375 [ F{"x"}<=4 s=2 ]') is True
    assert ask('P>0.375 [ F{"x"}<=4 s=2 ]') is False
    question = 'const int k; filter(max, P=? [ F{"x"}<=k s=2 ], s<2)'
    assert check_text(engine_of(CHAIN), question, {"k": "2"}).value == 0.5


def test_rewards_are_scaled():
    assert ask('P=? [ F{"x"}<=1.2 s=2 ]', u="0.3") == pytest.approx(0.375, rel=1e-12)
    assert ask('P=? [ F{"x"}<1.2 s=2 ]', u="0.3") == pytest.approx(0.25, rel=1e-12)
    assert ask('P=? [ F{"x"}<=4/3 s=2 ]', u="1/3") == pytest.approx(0.375, rel=1e-12)
    assert ask('P=? [ F{"x"}<=4/3 s=2 ]', engine="exact", u="1/3") == Fraction(3, 8)
    # A large step makes a large bound cheap.
    assert ask('P=? [ F{"x"}<=4e9 s=2 ]', u="1e9") == pytest.approx(0.375, rel=1e-12)


@pytest.mark.parametrize(
    ("u", "message"),
    [
        ("-1", r"-\d.0 in state \(s=\d\) is negative"),
        ("pow(2, 0.5)", r"1.414.* in state \(s=0\)"),
        ("1e-6", "too large"),
    ],
)
def test_rewards_of_other_kinds_are_refused(u, message):
    with pytest.raises(UnsupportedError, match=message):
        ask('P=? [ F{"x"}<=1000 s=2 ]', u=u)


def test_unlike_transitions_of_one_state_are_refused():
    both = CHAIN.replace("[c] s=2", "[] s=1 -> (s'=3);\n  [c] s=2")
    with pytest.raises(
        UnsupportedError, match=r"differs between the transitions of one state.*\(s=1\)"
    ):
        ask('P=? [ F{"y"}<=1 s=2 ]', both)
    assert ask('P=? [ F{"x"}<=4 s=2 ]', both) == pytest.approx(0.25 * 0.5 + 0.5 * 0.25 * 0.5 + 0)


def test_wrong_bounds():
    with pytest.raises(InputError):
        ask('P=? [ F^{rew{"none"}<=1} s=2 ]')
    with pytest.raises(InputError):
        ask('P=? [ F{"x"}[3,2] s=2 ]')
    with pytest.raises(InputError):
        ask('P=? [ F{"x"}<=-1 s=2 ]')
    with pytest.raises(UnsupportedError, match="several temporal operators"):
        ask('P=? [ F{"x"}<=1 (X s=2) ]')
    with pytest.raises(UnsupportedError, match="P>0 and P>=1"):
        ask('A [ F{"x"}<=1 s=2 ]')


def test_continuous_time():
    queue = """ctmc
    module q
      n : [0..3];
      [in] n<3 -> 2:(n'=n+1);
      [out] n=3 -> 1:(n'=2);
    endmodule
    rewards "jumps" [in] true : 1; [out] true : 1; endrewards
    rewards "time" true : 1; endrewards
    rewards "in" [in] true : 1; endrewards
    """
    assert ask('P=? [ F{"jumps"}<=2 n=3 ]', queue) == 0
    assert ask('P=? [ F{"jumps"}<=3 n=3 ]', queue) == 1
    assert ask('P=? [ F{"in"}<=3 n=3 ]', queue, "exact") == 1
    with pytest.raises(UnsupportedError, match="unit of time"):
        ask('P=? [ F{"time"}<=3 n=3 ]', queue)


def test_slow_cycles_without_reward():
    # 40 coins to walk from one end to the other, for free; then a step that costs.
    # (In the second walk there is a choice, so that equations are not simply inverted.)
    walk = """mdp
    module m
      s : [0..41];
      [] s=0 -> (s'=1);
      [] s>0 & s<40 -> 0.5:(s'=s+1) + 0.5:(s'=s-1);
      [pay] s=40 -> 0.25:(s'=41) + 0.75:(s'=0);
      [] s=41 -> true;
    endmodule
    rewards "r" [pay] true : 1; endrewards
    """
    either = walk.replace("[] s=0 ->", "[] s>0 & s<8 -> 0.75:(s'=s+1) + 0.25:(s'=s-1);\n [] s=0 ->")
    for model in (walk, either):
        for direction in ("min", "max"):
            assert ask(f'P{direction}=? [ F{{"r"}}<=20 s=41 ]', model) == pytest.approx(
                1 - 0.75**20, rel=1e-6
            )
    assert ask('Pmin=? [ F{"r"}>=0 s=41 ]', walk) == 1


def test_waiting_for_free():
    # Waiting in s=0 costs nothing: it never pays for the maximum, and keeps the minimum at 0.
    wait = """mdp
    module m
      s : [0..3];
      [] s=0 -> (s'=1);
      [] s=1 -> (s'=0);
      [go] s=1 -> 0.5:(s'=2) + 0.5:(s'=3);
      [go] s=3 -> (s'=0);
      [] s=2 -> true;
    endmodule
    rewards "r" [go] true : 1; endrewards
    """
    assert ask('Pmax=? [ F{"r"}<=5 s=2 ]', wait) == pytest.approx(0.875)
    assert ask('Pmin=? [ F{"r"}<=5 s=2 ]', wait) == 0
    assert ask('Pmax=? [ F{"r"}>=3 s=2 ]', wait) == pytest.approx(0.5)
    assert ask('Pmax=? [ F{"r"}[3,5] s=2 ]', wait) == pytest.approx(0.375)


class Counted:
    """A random chain or decision process, with the reward of each command, and the same with a variable that counts it."""

    def __init__(self, seed, kind):
        rng = Random(seed)
        self.kind, n = kind, rng.randint(3, 6)
        self.n = n
        state = [rng.choice((0, 0, 0, 1)) for _ in range(n)]
        commands, rewards, counting = [], [], []
        for s in range(n):
            for _ in range(1 if kind == "dtmc" else rng.randint(1, 2)):
                reward, name = rng.choice((0, 0, 1, 2)), f"a{len(commands)}"
                weights = [rng.randint(1, 3) for _ in range(rng.randint(1, 3))]
                targets = [rng.randrange(n) for _ in weights]
                total = sum(weights)
                plain = " + ".join(
                    f"{w}/{total}:(s'={t})" for w, t in zip(weights, targets, strict=True)
                )
                add = " + ".join(
                    f"{w}/{total}:(s'={t})&(c'=min(c+{reward + state[s]},8))"
                    for w, t in zip(weights, targets, strict=True)
                )
                commands.append(f"[{name}] s={s} -> {plain};")
                counting.append(f"[] s={s} -> {add};")
                rewards.append(f"[{name}] true : {reward};")
        rewards += [f"s={s} : {r};" for s, r in enumerate(state) if r]
        self.text = f"{kind}\nmodule m\n s:[0..{n - 1}];\n" + "\n".join(commands)
        self.text += '\nendmodule\nrewards "r"\n' + "\n".join(rewards) + "\nendrewards\n"
        self.counting = (
            f"{kind}\nmodule m\n s:[0..{n - 1}];\n c:[0..8];\n"
            + "\n".join(counting)
            + "\nendmodule\n"
        )

    def questions(self, seed):
        """Pairs: with a bound, and on the model that counts."""
        rng = Random(seed)
        p = "P=?" if self.kind == "dtmc" else f"P{rng.choice(('min', 'max'))}=?"
        goal, stay, low = rng.randrange(self.n), rng.randrange(self.n), rng.randint(0, 4)
        high = low + rng.randint(0, 3)
        return [
            (f'{p} [ F{{"r"}}<={high} s={goal} ]', f"{p} [ F (s={goal} & c<={high}) ]"),
            (
                f'{p} [ s!={stay} U{{"r"}}<={high} s={goal} ]',
                f"{p} [ s!={stay} U (s={goal} & c<={high}) ]",
            ),
            (f'{p} [ F{{"r"}}>={low} s={goal} ]', f"{p} [ F (s={goal} & c>={low}) ]"),
            (
                f'{p} [ s!={stay} U{{"r"}}[{low},{high}] s={goal} ]',
                f"{p} [ s!={stay} U (s={goal} & c>={low} & c<={high}) ]",
            ),
            (f'{p} [ G{{"r"}}<{high + 1} s!={goal} ]', f"{p} [ G (s!={goal} | c>{high}) ]"),
            (
                f'{p} [ F^{{rew{{"r"}}[{low},{high}], steps<=5}} s={goal} ]',
                f"{p} [ F<=5 (s={goal} & c>={low} & c<={high}) ]",
            ),
            (
                f'{p} [ F^{{rew{{"r"}}>={low + 3}, steps<=2}} s={goal} ]',
                f"{p} [ F<=2 (s={goal} & c>={low + 3}) ]",
            ),
        ]


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@SLOW
@given(seed=st.integers(0, 2**20))
@example(seed=519373)  # 1 minus a probability of 0.9997
def test_against_a_counter_in_the_model(kind, seed):
    model = Counted(seed, kind)
    exact, counting, engine = (
        engine_of(model.text, "exact"),
        engine_of(model.counting, "exact"),
        engine_of(model.text),
    )
    for bounded, counted in model.questions(seed):
        true = check_text(counting, counted).value
        assert check_text(exact, bounded).value == true, f"{bounded}\n{model.text}"
        result = check_text(engine, bounded)
        low, high = (v[0] for v in result.values.at(engine.initial))
        slip = 1e-12 if "G" in bounded else 0.0  # 1 minus a number that was rounded
        assert low * (1 - 1e-12) - slip <= true <= high * (1 + 1e-12) + slip, (
            f"{bounded}: [{low}, {high}], not {true}\n{model.text}"
        )
        assert high - low <= 1e-6 * high + slip


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@pytest.mark.parametrize("seed", range(12))
def test_against_storm(kind, seed, tmp_path):
    stormpy = pytest.importorskip("stormpy", reason="Storm's Python package is not installed")
    model = Counted(seed, kind)
    engine = engine_of(model.text)
    (tmp_path / "m.prism").write_text(model.text)
    program = stormpy.parse_prism_program(str(tmp_path / "m.prism"))
    for bounded, _ in model.questions(seed)[:2]:
        if "s!=0 U" in bounded:
            continue  # Storm does not see that the left side is wrong at once
        properties = stormpy.parse_properties(bounded, program)
        built = stormpy.build_model(program, properties)
        theirs = stormpy.model_checking(built, properties[0], only_initial_states=True).get_value(
            built.initial_states[0]
        )
        assert check_text(engine, bounded).value == pytest.approx(float(theirs), abs=1e-5), (
            f"{bounded}\n{model.text}"
        )


def test_successors_that_are_one_place_are_added():
    # s=2 only goes on to s=0, so that both are one place, and s=1 leads to both.
    model = """dtmc
    module m
      s : [0..3];
      [] s=0 -> 2/3:(s'=1) + 1/3:(s'=3);
      [] s=1 -> 2/7:(s'=0) + 2/7:(s'=3) + 3/7:(s'=2);
      [] s=2 -> (s'=0);
      [] s=3 -> (s'=0);
    endmodule
    rewards "x" s=3 : 1; endrewards
    """
    for k in (1, 2, 3):
        assert ask(f'P=? [ F{{"x"}}>={k} s=1 ]', model, engine="exact") == 1


@pytest.mark.parametrize("engine", list(BUILDERS))
def test_rates_are_no_probabilities(engine):
    """A cycle without reward, left with a tenth of the rate: 1, whatever the rates sum to."""
    text = """ctmc
    module m
      x : [0..1];
      y : [0..1];
      [] y=0 -> 1/3 : (y'=1) + 3 : (x'=1-x);
      [b] y=1 -> 5 : true;
    endmodule
    rewards "r"
      [b] true : 1;
    endrewards"""
    assert ask('P=? [ F^{rew{"r"}<=0} y=1 ]', model=text, engine=engine) == pytest.approx(
        1, rel=1e-9
    )
