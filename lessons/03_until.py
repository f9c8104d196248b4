# %% [markdown]
# # Lesson 3: Until: prob0, prob1, and equations for the rest
# After this lesson you can compute the probability of `a U b` in a Markov chain by hand: with two
# graph searches and one linear system.
#
# Time: 30 minutes. You need lesson 2 and linear equations. A question in *italics* is for you:
# answer it before you run the next cell.

# %%
import numpy as np
import symcheck
from symcheck import teach, view

die = symcheck.load("../models/die/die.pm")
view.state_graph(die)

# %% [markdown]
# ## The question
# `a U b` (*a until b*) holds on a path that reaches a state of `b`, and goes through states of `a`
# before. `F b` is `true U b`: any way will do. Most questions about a chain lead to an until, so
# this is the algorithm to know.
#
# Our question is: how probable is a six, `P=? [ F d=6 ]`? *You know the answer for a die. What is
# it if two tosses have led to state `s=6`, that is, how probable is a six from there?*
#
# ## Three kinds of states
# - **prob0**: `b` cannot be reached through `a`. The probability is 0.
# - **prob1**: no path that avoids `b` leads into prob0. The probability is 1.
# - **unknown**: the rest. Only these states need numbers.
#
# Both sets are found by searches in the graph, like that of lesson 2, only backward. No probability
# is looked at, and nothing is rounded, so they are exact. (C. Baier, J.-P. Katoen: Principles of
# Model Checking. MIT Press 2008, section 10.1.1.)
#
# The search for prob0 begins with the goal and adds predecessors: these states *can* reach it. What
# is left at the end is prob0.

# %%
for frame in teach.prob0(die, "true", "d=6"):
    print(frame)

# %% [markdown]
# Two states in the first frame, the six and `s=6`, then three, then four, and no more. The result
# is the complement: 9 of 13 states. *Which are they? Look for them in the picture above, then play
# the trace; the colour shows what the search has.*

# %%
teach.prob0(die, "true", "d=6")

# %% [markdown]
# The search for prob1 is a second one. It begins with prob0, and adds predecessors that are not in
# `b`: these states can *fail*. The complement is prob1.

# %%
for frame in teach.prob1(die, "true", "d=6"):
    print(frame)

# %% [markdown]
# First comes the same search as before; then the closure of prob0 has 12 states. Only one state is
# certain: the six itself. `where` gives such sets by a formula, and the three sets divide the
# states:

# %%
zero = die.where("P<=0 [ F d=6 ]")
one = die.where("P>=1 [ F d=6 ]")
unknown = ~(zero | one)
print(unknown)
assert (zero.count, one.count, unknown.count) == (9, 1, 3)

# %% [markdown]
# ## Three equations
# Let $x_s$ be the probability from $s$. One step is taken, and then the probability of the
# successor counts:
#
# $$x_s = \sum_t P(s,t)\, x_t$$
#
# with $x = 1$ on prob1 and $x = 0$ on prob0. For the unknown states $s=0$, 2 and 6 the picture says
#
# $$x_0 = \frac{1}{2} x_2, \quad x_2 = \frac{1}{2} x_6, \quad x_6 = \frac{1}{2} x_2 + \frac{1}{2}.$$
#
# (State 2 also goes to state 5, but $x_5 = 0$.) Put the second equation into the third:
# $x_6 = \tfrac{1}{4} x_6 + \tfrac{1}{2}$, so $x_6 = \tfrac{2}{3}$, $x_2 = \tfrac{1}{3}$, and
# $x_0 = \tfrac{1}{6}$.
#
# In general this is $x = Ax + b$: $A$ has the probabilities between unknown states, and $b_s$ is
# the probability of a step from $s$ into prob1. `teach.until_trace` shows what symcheck makes of
# it. *Which entries has $b$?*

# %%
trace = teach.until_trace(die, "true", "d=6")
print("b =", trace.problem.constant)
print("A: in the rows 0, 1, 2 stand", trace.problem.matrix.data)
print("in the columns", trace.problem.matrix.indices)
assert trace.problem.constant.tolist() == [0, 0, 0.5]

# %% [markdown]
# $A$ is stored as a *sparse* matrix: of each row, only the columns that are not 0. Row 0 has an
# entry in column 1 (the state $s=2$), row 1 in column 2 ($s=6$), and row 2 in column 1.
#
# ## The same with numpy
# `die.matrix` is the matrix $P$ of the whole chain. A *mask* is an array of truth values, and
# `P[np.ix_(r, c)]` takes the rows of one mask and the columns of another. First $A$ and $b$:

# %%
P = die.matrix.toarray()
u = unknown.mask
A = P[np.ix_(u, u)]
b = P[np.ix_(u, one.mask)].sum(axis=1)  # the sum over the states of prob1
print(A, b, sep="\n")

# %% [markdown]
# Then $x = Ax + b$ is $(I - A)\,x = b$, which numpy solves:

# %%
x = np.linalg.solve(np.eye(len(b)) - A, b)
for number, value in zip(unknown.numbers, x):
    print(die.states[number], round(value, 6))
assert np.allclose(x, [1 / 6, 1 / 3, 2 / 3])

# %% [markdown]
# And what does symcheck say? In the picture, each state shows its value below its variables. Check
# two of the equations there: a value is the mean of the values of the two successors.

# %%
result = die.check("P=? [ F d=6 ]")
assert np.allclose(x, np.asarray(result.values)[u])
view.state_graph(die, values=result)

# %% [markdown]
# ## Why prob0 comes first
# Could we not solve the equations of *all* states, and leave out the graph search? In this chain,
# state 0 goes to state 1 or to the goal, state 2; and state 1 stays where it is. *What does the
# equation of state 1 say?*

# %%
loop = symcheck.from_matrix([[0, 0.5, 0.5], [0, 1, 0], [0, 0, 1]], labels={"goal": [2]})
system = np.eye(2) - loop.matrix.toarray()[:2, :2]
print(system)
print("determinant:", np.linalg.det(system))
print(loop.check('P=? [ F "goal" ]'))
assert np.linalg.det(system) == 0

# %% [markdown]
# It says $x_1 = x_1$, which is true for every number. The system has a solution for each choice of
# $x_1$, and numpy would refuse it. The probability is the *least* non-negative solution (Baier and
# Katoen, section 10.1.1), and with $x_1 = 0$ for prob0 it is the only one: from every unknown state
# some path leaves the unknown states, so $A^k \to 0$, and $I - A$ can be inverted.
#
# prob1 is not necessary for this. But it makes the system smaller, and the answer to `P>=1 [ … ]`
# exact.
#
# ## What the `a` is for
# A gambler has 5 euros and bets one in each round, with equal chances, until he has 20 or nothing.
# He reaches 20 with probability 5/20 (lesson 4 computes it step by step). But how probable is it
# that he does so, and never has less than 3 on the way? *Which states are in prob0 now? Can you
# guess the value?*

# %%
gambler = symcheck.load("../models/gambler/gambler.pm")
wins = gambler.check("P=? [ F money=goal ]")
safely = gambler.check("P=? [ money>=3 U money=goal ]")
print(wins, safely, sep="\n")
assert np.isclose(float(wins), 5 / 20)
assert np.isclose(float(safely), 3 / 18)

# %% [markdown]
# All states with less than 3 are in prob0: they are outside of `a`, so they count as lost, although
# a path may go on from them and win. The rest is the same game with other ends: the gambler is 3
# above the lower end, 2, and the ends are 18 apart, so the value is 3/18.

# %%
print(gambler.where("P<=0 [ money>=3 U money=goal ]"))
assert gambler.where("P<=0 [ money>=3 U money=goal ]").count == 3

# %% [markdown]
# ## Summary
# - Two graph searches find prob0 and prob1, without numbers and without errors.
# - The unknown states have a linear system with one solution, *because* prob0 is out of it.
# - In large models the searches work on diagrams, and the system is solved by iteration: that is
#   lesson 4.
#
# ## Exercises

# %% [markdown]
# **Exercise 1.** Compute the expected number of tosses of the die, `R{"tosses"}=? [ F "done" ]`,
# with numpy. Which states are unknown, and what are the equations?

# %% [markdown] tags=["solution"]
# Unknown are all states that are not done. Each of them costs a toss: $x = 1 + Ax$.

# %% tags=["solution"]
P = die.matrix.toarray()
going = ~die.where('"done"').mask
tosses = np.linalg.solve(np.eye(going.sum()) - P[np.ix_(going, going)], np.ones(going.sum()))
assert np.isclose(tosses[0], 11 / 3)
assert np.isclose(tosses[0], float(die.check('R{"tosses"}=? [ F "done" ]')))

# %% [markdown] tags=["solution"]
# It is 11/3. Three tosses are always made; after them, a face is open with probability 1/4.

# %% [markdown]
# **Exercise 2.** Which states of `gambler` are unknown for `F money=goal`? Compute the values with
# numpy, and compare them with `money/goal` (W. Feller: An Introduction to Probability Theory and
# Its Applications, volume 1, third edition, Wiley 1968, XIV.2).

# %% [markdown] tags=["solution"]
# All but the two ends: from each of them both ends can be reached.

# %% tags=["solution"]
P = gambler.matrix.toarray()
inside = gambler.where("money>0 & money<goal").mask
won = gambler.where("money=goal").mask
A, b = P[np.ix_(inside, inside)], P[np.ix_(inside, won)].sum(axis=1)
x = np.linalg.solve(np.eye(len(b)) - A, b)
money = [gambler.states[number]["money"] for number in np.flatnonzero(inside)]
assert np.allclose(x, np.array(money) / 20)

# %% [markdown]
# **Exercise 3.** Which of the thresholds `P>=1`, `P>0`, `P<1`, `P<=0` and `P>=0.5` are decided
# without any number? Try `die.where("P>0 [ F d=6 ]")` and the others, and count.

# %% [markdown] tags=["solution"]
# The first four: prob1, the complement of prob0, the complement of prob1, and prob0. Only 0.5 needs
# the values of the unknown states.

# %% tags=["solution"]
counts = {t: die.where(f"P{t} [ F d=6 ]").count for t in (">=1", ">0", "<1", "<=0", ">=0.5")}
assert counts == {">=1": 1, ">0": 4, "<1": 12, "<=0": 9, ">=0.5": 2}
