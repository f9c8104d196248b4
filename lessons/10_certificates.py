# %% [markdown]
# # Lesson 10: Certificates
# After this lesson you can check a probability of a decision process by hand, say what an upper and
# a lower bound need, and explain why a lower bound needs ranks.
#
# Time: 40 minutes. You need lessons 3 and 5.
#
# The equations are in C. Baier and J.-P. Katoen, *Principles of Model Checking*, MIT Press 2008,
# section 10.6.1. Certificates with ranks are from K. Chatterjee, T. Quatmann, M. Schäffeler, M.
# Weininger, T. Winkler and D. Zilken, TACAS 2025. [Certificates](../docs/certificates.md) lists the
# rules for all other measures.

# %% [markdown]
# ## A value that somebody else has to believe
# A model checker is a large program, and large programs have errors. You could read all of it, or
# write another one and compare. A third way is better: let the model checker *prove* its value in a
# form that you can check with a few lines of your own. This is a **certificate**: vectors that
# satisfy inequalities. How the vectors were found does not matter, as it does not matter how
# somebody found the factors of a number that you can multiply.
#
# The player of this game owns 3 coins, stakes up to 4 of them in each round, and wins a round with
# probability 0.4. The game ends with 8 coins (`rich`) or with none (`ruined`). We ask for the best
# chance to get rich.

# %%
import json
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from tempfile import mkdtemp

import symcheck

game = symcheck.load("../models/gambler/stakes.nm")
result = game.check('Pmax=? [ F "rich" ]')
proof = result.certificate()
print(result)
proof

# %% [markdown]
# The certificate claims two fractions for state 3, close to 0.256 on both sides. It is written with
# the model that it is about:

# %%
folder = Path(mkdtemp())
files = symcheck.save_certificate(proof, folder / "proof.json")
print([Path(file).name for file in files])

# %% [markdown]
# `proof.tra` has the transitions and `proof.lab` the labels; the two others have rewards and do not
# matter here. After a first line with the numbers of states, choices and transitions, each line of
# the transitions is `state choice target probability`. *Look at the lines of state 3:* which choice
# is which stake?

# %%
print("\n".join((folder / "proof.tra").read_text().splitlines()[:15]))

# %% [markdown]
# ## Reading the model
# From here on nothing of symcheck is used: what you trust is the next few cells. `rows[s]` becomes
# a list with a distribution for each choice of state `s`, and a distribution maps targets to
# probabilities. Probabilities are fractions, so nothing is rounded.

# %%
first, *lines = (folder / "proof.tra").read_text().splitlines()
states = int(first.split()[0])
rows = [[] for _ in range(states)]
for line in lines:
    state, choice, target, probability = line.split()[:4]
    if int(choice) == len(rows[int(state)]):  # the first line of a new choice
        rows[int(state)].append({})
    rows[int(state)][int(choice)][int(target)] = Fraction(probability)
rows[3]

# %% [markdown]
# Three choices, for the stakes 1, 2 and 3: each loses with probability 3/5 and wins with 2/5.
#
# A file of labels has the numbers of the labels in its first line, and then the labels of each
# state that has one:

# %%
print((folder / "proof.lab").read_text())

# %% [markdown]
# The label `rich` has number 2, which stands at state 8 only. We could read this with the eye; here
# is the code:

# %%
first, *lines = (folder / "proof.lab").read_text().splitlines()
number = {name: n for n, name in (part.split("=") for part in first.split())}['"rich"']
rich = {int(line.split(":")[0]) for line in lines if number in line.split(":")[1].split()}
assert (states, rich) == (9, {8})

# %% [markdown]
# A row is a distribution only if it sums to 1. *Think:* would 0.33333 in place of 1/3 do?

# %%
assert all(sum(row.values()) == 1 for choices in rows for row in choices)
print(sum([Fraction("0.33333")] * 3))

# %% [markdown]
# It would not: three times 0.33333 is another model, with a small probability of vanishing. This is
# why the files have fractions.
#
# ## The upper bound
# Let $x_s \ge 0$ be a number for each state with $x_s \ge 1$ on the goal, and elsewhere for
# **every** choice $a$
#
# $$x_s \;\ge\; \sum_t P(s,a,t)\,x_t .$$
#
# Then no strategy reaches the goal from $s$ with a higher probability than $x_s$. *Proof:* let
# $p^n_s$ be the best probability of reaching the goal within $n$ steps. $p^0 \le x$, because $p^0$
# is 1 on the goal and 0 elsewhere. If $p^n \le x$, then $p^{n+1}_s$ is the largest
# $\sum_t P(s,a,t)\,p^n_t \le \sum_t P(s,a,t)\,x_t \le x_s$. So $p^n \le x$ for all $n$, and the
# probability is the limit.
#
# The vectors are in the part `evidence` of the JSON file, as numerators over one denominator.
# `mean` is the sum on the right side.

# %%
evidence = json.loads((folder / "proof.json").read_text())["evidence"]


def vector(side):
    denominator = int(side["vector"]["denominator"])
    return [Fraction(n, denominator) for n in side["vector"]["numerators"]]


def mean(row, x):
    return sum(p * x[t] for t, p in row.items())


upper = vector(evidence["upper"])
for choice, row in enumerate(rows[3]):
    print(f"choice {choice}: {float(mean(row, upper)):.6f} <= {float(upper[3]):.6f}")

# %% [markdown]
# For state 3, two of the three choices come as near to the bound as one can see: to stake 1 and to
# stake 3. Both are optimal. Bold play (L. E. Dubins and L. J. Savage, *How to Gamble If You Must*,
# McGraw-Hill 1965, chapter 5) is one of several best strategies here.
#
# Now for all states. The function returns where an inequality fails, so an empty list is a proof:


# %%
def upper_fails(x):
    low = [s for s in range(states) if x[s] < (1 if s in rich else 0)]
    return low + [
        s for s in range(states) if s not in rich for row in rows[s] if x[s] < mean(row, x)
    ]


assert upper_fails(upper) == []
print("the value is at most", float(upper[3]))

# %% [markdown]
# ## The lower bound
# For a lower bound of a maximum, one strategy is enough. The certificate has a choice for each
# state. Its rows make a Markov chain, and we turn the inequalities around: $x_s \le 1$ on the goal,
# and $x_s \le \sum_t P(s,t)\,x_t$ elsewhere.
#
# *Before you go on:* is every such $x$ a lower bound? Try to repeat the proof above with $\ge$
# instead of $\le$. Where does it break?

# %%
lower, choices = vector(evidence["lower"]), evidence["lower"]["choices"]
chosen = [of_state[choice] for of_state, choice in zip(rows, choices, strict=True)]


def mean_fails(x):
    high = [s for s in rich if x[s] > 1]
    return high + [s for s in range(states) if s not in rich and x[s] > mean(chosen[s], x)]


assert mean_fails(lower) == []
print("choices:", choices, "lower vector of state 3:", float(lower[3]))

# %% [markdown]
# The vector satisfies these inequalities. But so does this one, which is wrong in every state but
# the goal:

# %%
wrong = [Fraction(1)] * states
assert mean_fails(wrong) == []
print("claimed for the ruined player:", wrong[0])

# %% [markdown]
# Who is ruined stays so for ever, and in the state `ruined`, $x_0 \le x_0$ holds for any number.
# The induction breaks at its beginning: $p^0 \ge x$ is false. An upper bound may sit and wait; a
# lower bound has to show that something *happens*.
#
# ## Ranks
# What is missing is progress. A **rank** is a whole number for each state with $x_s > 0$, and some
# transition of the chosen row has to lower it, down to the goal. *Before you run the cell:* which
# rank can the ruined state have?

# %%
ranks = evidence["lower"]["ranks"]
print("ranks:", ranks)


def rank_fails(x, ranks):
    failing = []
    for s in range(states):
        if s in rich or x[s] <= 0:
            continue
        following = [ranks[t] for t in chosen[s] if ranks[t] is not None]
        if ranks[s] is None or not following or min(following) >= ranks[s]:
            failing.append(s)
    return failing


assert rank_fails(lower, ranks) == []

# %% [markdown]
# It has none (`None`): its only transition leads to itself and cannot lower anything. So $x_0$ has
# to be 0. The goal has rank 0, and the rank of the others is the number of rounds that have to be
# won, in the best case.
#
# *Proof that this suffices.* Follow the chain from $s$ and stop at the goal or where $x \le 0$.
# Each step keeps or raises the mean of $x$, so $x_s$ is at most the mean of $x$ after $n$ steps.
# Runs that have stopped at the goal add at most 1 each, those that have stopped elsewhere add
# nothing, and those that still run add at most the largest entry of $x$. So
#
# $$x_s \;\le\; \Pr(\text{goal within } n) \;+\; \max x \cdot \Pr(\text{still running after } n).$$
#
# Ranks make the last term vanish: from every running state, some path of falling ranks stops within
# as many steps as there are ranks. So in each stretch of that many steps, a run stops with a
# probability of at least some $\varepsilon > 0$.
#
# Can you save the wrong vector with ranks of your own? Whatever you invent, the ruined state fails:

# %%
for first_rank in range(5):
    invented = [first_rank, *range(8, 0, -1)]
    invented[8] = 0
    print(invented, "fails in states", rank_fails(wrong, invented))
    assert 0 in rank_fails(wrong, invented)

# %% [markdown]
# So the value lies between two numbers that you have checked yourself, and the exact value
# $\frac{32}{125}$ is indeed between them:

# %%
print(float(lower[3]), "<=", "value", "<=", float(upper[3]))
assert lower[3] <= Fraction(32, 125) <= upper[3]
assert upper[3] - lower[3] < Fraction(1, 10**13)

# %% [markdown]
# ## A checker that is not yours
# `symcheck-verify` makes the same checks, and those of rewards, long-run averages and bounds on
# steps. It is a program of some 600 lines that imports nothing of symcheck; a second file has the
# rules about time and automata. It is in the folder `verify` of the repository:


# %%
def verify():
    command = [
        sys.executable,
        "../verify/symcheck_verify.py",
        folder / "proof.tra",
        folder / "proof.json",
    ]
    print(subprocess.run(command, capture_output=True, text=True, check=False).stdout)


verify()

# %% [markdown]
# Read what it says. It accepts a *statement* about *this file*. Two things remain to be trusted, or
# to be checked in another way: that the file is the model which you mean, and that the statement
# (until, from all states, to the label `rich`, the maximum) is the question which you mean.
#
# Now play the forger. First a lower vector that is a little too large in state 3, then a game in
# which the player wins more often:

# %%
written = (folder / "proof.json").read_text()
numerator = str(evidence["lower"]["vector"]["numerators"][3])
assert written.count(f" {numerator},") == 1
(folder / "proof.json").write_text(
    written.replace(f" {numerator},", f" {int(numerator) + 10**17},")
)
verify()
_ = (folder / "proof.json").write_text(written)

transitions = (folder / "proof.tra").read_text()
(folder / "proof.tra").write_text(
    transitions.replace("3 0 2 3/5\n3 0 4 2/5", "3 0 2 2/5\n3 0 4 3/5")
)
verify()
_ = (folder / "proof.tra").write_text(transitions)
# %% [markdown]
# The first one fails because of an inequality, the second because the certificate has a digest
# (SHA-256) of the model that it is about.
#
# ## Summary
# - A certificate is checked by inequalities in exact arithmetic; how it was found does not matter.
# - For a maximum, an upper bound satisfies $x \ge Px$ for all choices; a lower bound satisfies
#   $x \le Px$ for one strategy.
# - A lower bound of a probability needs ranks as well: without progress to the goal, $x \le Px$
#   says nothing.
# - What is proved is a statement about a file. That both are what you mean is up to you.

# %% [markdown]
# ## Exercises

# %% [markdown]
# **Exercise 1.** Raise the lower bound of state 3 by 0.01. Which inequality fails? Then lower it by
# 0.01. Which one fails now?

# %% [markdown] tags=["solution"]
# Raised, that of state 3 itself: its chosen row has a smaller mean. Lowered, none fails: state 3
# itself has room, and no other chosen row leads to state 3. It is a certificate of a looser bound.
# (Had another row led there, that one would have failed.)

# %% tags=["solution"]
for change in (Fraction(1, 100), -Fraction(1, 100)):
    changed = list(lower)
    changed[3] += change
    print(change, "fails in", mean_fails(changed))
    assert mean_fails(changed) == ([3] if change > 0 else [])
assert not any(3 in row for row in chosen)

# %% [markdown]
# **Exercise 2.** Is the exact solution (the value 32/125 in state 3, and so on) a certificate too?
# Load the game with `exact=True`; `list(result.values)` has the values as fractions. Which
# inequalities hold with equality?

# %% [markdown] tags=["solution"]
# Yes: the exact values satisfy all upper inequalities, and those of optimal choices with equality.
# For the lower bound, take optimal choices that also have ranks: a choice that leads back may
# satisfy the equality without progress. The choices and ranks of the certificate do.

# %% tags=["solution"]
exact = symcheck.load("../models/gambler/stakes.nm", exact=True)
values = list(exact.check('Pmax=? [ F "rich" ]').values)
assert values[3] == Fraction(32, 125)
assert upper_fails(values) == mean_fails(values) == rank_fails(values, ranks) == []
for s in range(1, 8):
    print(
        s,
        values[s],
        "optimal choices:",
        [a for a, row in enumerate(rows[s]) if mean(row, values) == values[s]],
    )

# %% [markdown]
# **Exercise 3.** A colleague says: "For a *minimum* it is the other way round, so I need ranks for
# the upper bound." Is that right? Write the certificate of `Pmin=? [ F "rich" ]` and see which side
# has `choices` and which has `ranks`. Then check it with functions of your own.

# %% [markdown] tags=["solution"]
# No: an upper bound never needs ranks, because the induction over steps proves it. What is the
# other way round is who chooses. An upper bound of a minimum needs one strategy; a lower bound has
# to hold for **all** rows of a state, and each of them has to lower the rank.

# %% tags=["solution"]
symcheck.save_certificate(game.check('Pmin=? [ F "rich" ]').certificate(), folder / "least.json")
least = json.loads((folder / "least.json").read_text())["evidence"]
print({side: sorted(parts) for side, parts in least.items()})
high, timid = vector(least["upper"]), least["upper"]["choices"]
low, ranked = vector(least["lower"]), least["lower"]["ranks"]
assert all(high[s] >= (1 if s in rich else 0) for s in range(states))
assert all(low[s] <= 1 for s in rich)
for s in set(range(states)) - rich:
    assert high[s] >= mean(rows[s][timid[s]], high)
    for row in rows[s]:
        assert low[s] <= mean(row, low)
        assert low[s] <= 0 or any(ranked[t] is not None and ranked[t] < ranked[s] for t in row)
print(float(low[3]), "<= least value <=", float(high[3]), "| ranks", ranked)

# %% [markdown]
# **Exercise 4.** Which choices does the strategy of the minimum make, and why are its ranks larger
# than those of the maximum?

# %% [markdown] tags=["solution"]
# It always stakes one coin (choice 0). Each round is unfavourable, and with small stakes the most
# rounds are played. The ranks are 8 minus the number of coins. With the stake 1, so many rounds
# have to be won; the ranks have to be lowered by the rows of all stakes, and a larger stake lowers
# them by more.

# %% tags=["solution"]
assert timid[1:8] == [0] * 7
assert ranked[1:] == [8 - coins for coins in range(1, 9)]

# %% [markdown]
# **Exercise 5.** A lower bound of an expected *reward* until the goal, $x \le r + Px$ with rewards
# $r \ge 0$, needs no ranks, even for a minimum. Why?

# %% [markdown] tags=["solution"]
# A strategy that misses the goal with a positive probability has an infinite expected reward by
# definition, which is above any bound. All others reach the goal with probability 1, so the
# probability of a run that still goes on vanishes by itself, and $x \le r + Px$ bounds the reward
# from below. For an upper bound it is the other way round: it has to prove that the goal is reached
# with probability 1, so it needs ranks.
