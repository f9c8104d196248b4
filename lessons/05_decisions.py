# %% [markdown]
# # Lesson 5: Decision processes and strategies
# After this lesson you can compute the best and the worst probability over all strategies, read a
# strategy, and improve one by policy iteration.
#
# Time: 40 minutes. You need lessons 3 and 4. A question in *italics* is for you: answer it before
# you run the next cell.

# %%
from itertools import product

import numpy as np
import symcheck
from symcheck import view

text = open("../models/gambler/stakes.nm").read()
gambler = symcheck.loads(text)
print(text[text.index("mdp") :])

# %% [markdown]
# ## Choices
# The type of this model is `mdp`: a *Markov decision process*. In some states several commands are
# enabled, and none of them has a probability: somebody chooses. Here it is the gambler, who chooses
# the stake. He has 3 of the 8 units that he wants, and wins a bet with probability 0.4.
#
# In other models nobody knows who chooses: the order in which processes act, or an attacker. Then
# one asks for the worst case. A **strategy** is a rule that chooses; also called policy, scheduler
# or adversary. Under a strategy, nothing is open any more, and the process is a Markov chain as in
# lesson 3.
#
# *The game is not in the gambler's favour. Should he bet boldly, much at once, or timidly, one unit
# each time?*

# %%
small = symcheck.loads(text.replace("goal = 8", "goal = 4").replace("start = 3", "start = 2"))
view.state_graph(small)

# %% [markdown]
# The picture shows a smaller game, from 2 units to 4. Between a state and its successors, it has a
# small point for each choice: the arrow to the point has the stake, and those that leave it have
# probabilities. With 2 units, there are two choices. (In the larger game, the picture is a tangle.)
#
# A choice is a row of `gambler.matrix`. This cell notes the rows of each state, by the name of the
# action; `None` is the command without a name. (States are numbered by money here.)

# %%
P = gambler.matrix.toarray()
choices = {state: {} for state in range(9)}
for source, action, row in zip(
    gambler.transitions.source, gambler.transitions.action, gambler.transitions.choice
):
    choices[int(source)][action] = int(row)
print(choices[2])
print("stake 2 with 2 units:", P[choices[2]["stake2"]])

# %% [markdown]
# With 2 units, staking both leads to 0 with probability 0.6, and to 4 with 0.4.
#
# ## All strategies
# How many strategies are there, if the choice depends on the state only? Multiply the numbers of
# choices of all states: $1 \cdot 2 \cdot 3 \cdot 4 \cdot 3 \cdot 2 \cdot 1 = 144$ for 1 to 7 units.
# That is few enough to try them all. The chain of a strategy has one row per state, and lesson 3
# solves it:

# %%
def value(strategy):
    """The probability of becoming rich with 1 to 7 units."""
    rows = np.array([P[choices[state][strategy[state]]] for state in range(9)])
    A, b = rows[1:8, 1:8], rows[1:8, 8]  # states 0 and 8 are decided
    return np.linalg.solve(np.eye(7) - A, b)


strategies = list(product(*choices.values()))
values = [value(strategy)[2] for strategy in strategies]  # with 3 units
print(len(strategies), "strategies, from", min(values), "to", max(values))
assert len(strategies) == 144

# %% [markdown]
# The choice decides between 10 % and 26 %. *Which strategy is the worst one, do you think?*
#
# A strategy may also remember the past, or toss a coin itself. For reachability neither helps: some
# strategy that looks at the current state only is the best (Baier and Katoen, Principles of Model
# Checking, MIT Press 2008, lemma 10.102). So we have seen the true extremes. But the number of such
# strategies grows exponentially with the number of states, and nobody can try them all in a larger
# model.
#
# ## The best strategy
# `Pmax=?` asks for the greatest probability over all strategies, `Pmin=?` for the least. With the
# option `strategy`, the result has the strategy, too.

# %%
best = gambler.with_options(strategy=True).check('Pmax=? [ F "rich" ]')
worst = gambler.with_options(strategy=True).check('Pmin=? [ F "rich" ]')
print(best, best.strategy, worst, worst.strategy, sep="\n")
assert np.isclose(float(best), max(values))
assert np.isclose(float(worst), min(values))

# %% [markdown]
# A table lists the states that are reached under the strategy. The worst strategy is the timid one.
# A best one is bold: with 4, stake 4. With 3 units it stakes only 1, though. Is that bold? The bold
# gambler stakes all he has, or what is missing if that is less: 3. Both have the same value here, a
# *tie*, and symcheck gives one of the best strategies:

# %%
bold = (None, "stake1", "stake2", "stake3", "stake4", "stake3", "stake2", "stake1", None)
p = 0.4
print("bold:", value(bold).round(4))
print("number of best strategies:", sum(np.isclose(v, max(values)) for v in values))
assert np.isclose(value(bold)[2], float(best))
assert np.isclose(float(best), p * p * (2 - p))

# %% [markdown]
# Bold play is optimal in every game with $p \le 1/2$ (L. E. Dubins, L. J. Savage: How to Gamble If
# You Must. McGraw-Hill 1965, chapter 5). With 3 of 8 units it wins with
# $p \cdot (p + (1-p)\,p) = p^2 (2-p)$: the first bet must be won (to 6 units), and then either the
# second one (to 8), or, if that is lost (4 left), the third one. *What is the intuition?* Each bet
# costs a part of the stake on average; whoever plays long pays often.
#
# Under a strategy, the process is a chain, the *induced chain*. It has only the states that are
# reached, with their values:

# %%
chain = symcheck.induced_chain(gambler, best.strategy)
assert chain.type.value == "dtmc"
assert len(chain.states) == 5
view.state_graph(chain, values=chain.check('P=? [ F "rich" ]'))

# %% [markdown]
# ## Value iteration, with a maximum
# In a chain, a value is the average of the values of the successors. Now the best choice counts:
#
# $$x_s = \max_a \sum_t P(s,a,t)\, x_t$$
#
# These equations are not linear, but one can iterate as in lesson 4: average for each choice, take
# the maximum for each state, repeat. (R. Bellman: Dynamic Programming. Princeton University Press
# 1957.)

# %%
x = np.zeros(9)
x[8] = 1
for iteration in range(1, 31):
    of_choice = P @ x  # a value for each choice
    x = np.array([max(of_choice[row] for row in choices[state].values()) for state in range(9)])
    if iteration in (1, 2, 3, 5, 30):
        print(iteration, x.round(4))
assert np.isclose(x[3], float(best))

# %% [markdown]
# After the first iteration, states 4 to 7 have the value 0.4: they can win with one bet. Three
# iterations are enough here, because bold play ends after at most three bets, wherever it starts.
# In other games the values only converge, with the trouble of lesson 4.
#
# ## Policy iteration
# R. A. Howard's method (Dynamic Programming and Markov Processes. MIT Press 1960) alternates two
# steps:
#
# 1. *Evaluate*: solve the chain of the current strategy.
# 2. *Improve*: in each state, look for a choice that is better if all later choices follow the
#    current strategy. Change to it.
#
# Each round is at least as good in all states, and better in one of them. There are finitely many
# strategies, so it ends; and a strategy that no single change improves is optimal. (This is so
# because the game ends under every strategy. In other models, prob0 needs care first.) Begin with
# the worst one, timid play:

# %%
def improve(strategy, x):
    """The strategy with each choice replaced by the best one for the values x."""
    better = list(strategy)
    for state in range(1, 8):
        for action, row in choices[state].items():
            if P[row] @ x > P[choices[state][better[state]]] @ x + 1e-12:
                better[state] = action
    return better


timid = [None, *["stake1"] * 7, None]
strategy, improved = None, timid
while improved != strategy:
    strategy = improved
    x = np.array([0, *value(strategy), 1])
    print(f"{x[3]:.4f}", strategy[1:8])
    improved = improve(strategy, x)
assert np.isclose(x[3], float(best))
assert strategy == list(bold)

# %% [markdown]
# One improvement leads from the worst strategy to bold play: every state with a choice changes at
# once. The second round finds nothing to improve, which *proves* that the strategy is optimal. The
# `1e-12` is important: without it, rounding errors could make the method go round between
# strategies of equal value for ever. symcheck does the same with `method="policy"`:

# %%
result = gambler.with_options(method="policy").check('Pmax=? [ F "rich" ]')
print(result)
print(result.runs[0].explanation)

# %% [markdown]
# ## Two aims at once
# Being rich and betting rarely are two aims. `multi` asks what can be had together: a *Pareto
# front*, whose points are the pairs that cannot be improved in one aim without a loss in the other.
# *Is there anything to trade in this game?*

# %%
front = gambler.check('multi(Pmax=? [ F "rich" ], R{"bets"}min=? [ C ])')
print(front.value)
assert len(front.value) == 1

# %% [markdown]
# No: bold play is best for both, with 1.64 bets on average. That changes if the game is in the
# gambler's favour. With `win=0.6`, patience is an advantage, but it takes time:

# %%
favourable = symcheck.loads(text.replace("win = 0.4", "win = 0.6"))
front = favourable.check('multi(Pmax=? [ F "rich" ], R{"bets"}min=? [ C ])').front
print(front)
front.plot();

# %% [markdown]
# Each vertex is a strategy; on the lines between them lie strategies that toss a coin once, at the
# beginning, between two others. From the boldest one (50 % in fewer than two bets) to the most
# patient one, the chances rise to 73 %, and the bets to 14 on average. Each further percent costs
# more bets than the one before, so the front is curved.
#
# ## Summary
# - An MDP leaves choices open. A strategy closes them, and leaves a chain.
# - `Pmax` and `Pmin` are the extremes over all strategies; strategies without memory have them.
# - Value iteration takes the maximum in each step. Policy iteration solves a chain in each round,
#   and ends with an optimal strategy.
# - Several aims have a front.
#
# ## Exercises

# %% [markdown]
# **Exercise 1.** With `win=0.6`, which strategy is best, and which is the worst one? Guess, then
# ask `favourable` with the option `strategy`. Explain.

# %% tags=["solution"]
asked = favourable.with_options(strategy=True)
patient, hasty = asked.check('Pmax=? [ F "rich" ]'), asked.check('Pmin=? [ F "rich" ]')
print(patient, patient.strategy, hasty, hasty.strategy, sep="\n")
assert set(dict(patient.strategy).values()) == {"", "stake1"}

# %% [markdown] tags=["solution"]
# Timid play: many small bets give the law of large numbers time to work for the gambler. Bold play
# is the worst, because it lets one or two bets decide. It is the picture of the unfavourable game
# in a mirror: exchange the gambler and the bank.

# %% [markdown]
# **Exercise 2.** In `models/dining/dining.nm`, the scheduler chooses which philosopher acts. How
# many acts pass on average before somebody eats, at best and at worst:
# `R{"acts"}min=? [ F "eating" ]`, and `max`? Can the worst scheduler prevent it for ever?

# %% tags=["solution"]
dining = symcheck.load("../models/dining/dining.nm")
fast, slow = (dining.check(f'R{{"acts"}}{d}=? [ F "eating" ]') for d in ("min", "max"))
print(fast, slow, dining.check('Pmin=? [ F "eating" ]'), sep="\n")
assert np.isclose(float(fast), 3)
assert np.isclose(float(slow), 13.5)

# %% [markdown] tags=["solution"]
# Three acts at best: one philosopher tosses, and takes one fork after the other. 13.5 at worst.
# Nobody can prevent it: the minimal probability is 1, which is what Lehmann and Rabin proved of
# their algorithm. The scheduler chooses who acts, but not how the coins fall.

# %% [markdown]
# **Exercise 3.** Check the value of the best strategy by sampling: `chain.estimate` with 10 000
# paths. Does the interval tell bold play from a strategy with the value 0.25? Then look at one
# path, with `gambler.simulator(seed=1)`, whose `run` takes a `strategy`.

# %% tags=["solution"]
estimate = chain.estimate('P=? [ F "rich" ]', samples=10_000, seed=1)
print(estimate)
low, high = estimate.bounds
assert low < 0.25 < 0.256 < high

# %% [markdown] tags=["solution"]
# It contains 0.256, and 0.25, too: 10 000 paths do not tell them apart. The interval is about 0.02
# wide; to make it three times narrower takes nine times as many paths.

# %% tags=["solution"]
simulator = gambler.simulator(seed=1)
simulator.run(steps=4, strategy=best.strategy)
print(simulator.path)

# %% [markdown]
# **Exercise 4.** Write a function that makes a strategy *worse*, and begin with bold play. Compare
# the result with `worst`.

# %% tags=["solution"]
def worsen(strategy, x):
    worse = list(strategy)
    for state in range(1, 8):
        for action, row in choices[state].items():
            if P[row] @ x < P[choices[state][worse[state]]] @ x - 1e-12:
                worse[state] = action
    return worse


strategy, changed = None, list(bold)
while changed != strategy:
    strategy = changed
    x = np.array([0, *value(strategy), 1])
    print(f"{x[3]:.4f}", strategy[1:8])
    changed = worsen(strategy, x)
assert strategy == timid
assert np.isclose(x[3], float(worst))

# %% [markdown] tags=["solution"]
# The method does not care about the direction: it finds timid play.
