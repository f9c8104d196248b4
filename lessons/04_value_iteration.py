# %% [markdown]
# # Lesson 4: Value iteration, and why stopping lies
# After this lesson you can iterate values and bounds, say why a small change does not mean a small
# error, and name three ways to a proved result.
#
# Time: 40 minutes. You need lesson 3. A question in *italics* is for you: answer it before you run
# the next cell.

# %%
import numpy as np
import symcheck
from symcheck import teach, view

# %% [markdown]
# ## The gambler
# Lesson 3 ended with equations $x = Ax + b$ for the unknown states. For three states we solved them
# by hand, and for a thousand numpy does. With a hundred million states, elimination may need more
# memory than there is, and one *iterates*.
#
# Our example is small, so that we know the truth. A gambler has 5 euros and bets one in each round,
# with equal chances, until he has 20 or nothing. He wins with probability 5/20 (W. Feller: An
# Introduction to Probability Theory and Its Applications, volume 1, third edition, Wiley 1968,
# XIV.2).

# %%
gambler = symcheck.load("../models/gambler/gambler.pm")
P = gambler.matrix.toarray()
inside = gambler.where("money>0 & money<goal").mask  # the unknown states: 1 to 19 euros
won = gambler.where("money=goal").mask

A = P[np.ix_(inside, inside)]
b = P[np.ix_(inside, won)].sum(axis=1)
start = 4  # the row of "5 euros" among the unknown states
print(A[start], b, sep="\n")

# %% [markdown]
# Row 4 of $A$ has 1/2 beside the diagonal, for one euro less and one more. $b$ is 1/2 in the last
# place only: with 19 euros, one round can win.
#
# ## Iterate from below
# Begin with 0 everywhere and apply the equations as an assignment, $x \leftarrow Ax + b$. The first
# iterates have a meaning: after $k$ of them, $x_s$ is the probability of winning *within $k$
# steps*. So the values only grow, and approach the probability of winning at all. *With 5 euros,
# after how many iterations is the value of the start positive for the first time?*

# %%
x = np.zeros(len(b))
for k in range(1, 17):
    x = A @ x + b
    if k in (1, 2, 14, 15, 16):
        print(k, x[start])
assert x[start] == 0.5**15

# %% [markdown]
# After 15: he has to win 15 times in a row. (And nothing changes in iteration 16: with 5 euros,
# only an odd number of rounds leads to 20.)
#
# When do we stop? The obvious rule is: when nothing changes much. *Guess how large the error is if
# we stop when no value changes by more than $10^{-6}$.*

# %%
x, iterations = np.zeros(len(b)), 0
while True:
    new = A @ x + b
    change = np.max(new - x)
    x, iterations = new, iterations + 1
    if change < 1e-6:
        break
error = 0.25 - x[start]
print(f"stopped after {iterations} iterations at {x[start]:.6f}")
print(f"the error is {error:.1e}, {error / change:.0f} times the last change")
assert 25 < error / change < 30

# %% [markdown]
# The error is nearly thirty times the last change. Where does it come from? All changes that were
# *not* made add up to it. In the long run, two steps shrink all changes by the factor $\lambda^2$,
# where $\lambda$ is the largest eigenvalue of $A$. (We count two steps at once, because only each
# second one changes a state.) What is left is a geometric series,
# $\lambda^2 + \lambda^4 + \dots = \lambda^2 / (1 - \lambda^2)$ times the last change:

# %%
largest = max(abs(np.linalg.eigvals(A)))
print("largest eigenvalue:", round(largest, 4))
print("factor:", round(largest**2 / (1 - largest**2), 1))
truth = np.linalg.solve(np.eye(len(b)) - A, b)
print("largest error / change:", round(np.max(truth - x) / change, 1))
assert np.isclose(largest, np.cos(np.pi / 20))

# %% [markdown]
# The theory says 40. The largest error is a little above, because the last change is not yet as
# small as the slowest part makes it. $1 - \lambda$ is the part of the games
# still going on that end in a step, in the long run. The slower the chain, the closer $\lambda$ is
# to 1, and the worse the rule. And you cannot correct for it without $\lambda$, which is no easier
# to compute than the values. (This rule is the *absolute* criterion, which textbooks and tools
# use.)
#
# ## A chain where it is hopeless
# It can be as bad as one likes. S. Haddad and B. Monmege (Interval iteration algorithm for MDPs and
# IMDPs. Theoretical Computer Science 735, 2018) give a chain with $2n+1$ states in a row. From the
# middle, 0, the walk goes left or right. Each step away from the middle succeeds with probability
# 1/2, and otherwise it falls back to the middle. *How probable is it that the walk ends on the
# right?*

# %%
def chain(n):
    def step(k):
        if abs(k) == n:
            return {k: 1}
        if k == 0:
            return {1: 0.5, -1: 0.5}
        away = k + (1 if k > 0 else -1)
        return {away: 0.5, 0: 0.5}

    return symcheck.from_function(0, step, labels={"right": lambda k: k == n})


view.state_graph(chain(3))

# %% [markdown]
# It is 1/2, by symmetry. But $n$ steps in one direction must succeed one after the other. For
# $n=20$, we iterate as before:

# %%
slow = chain(20)
matrix = slow.matrix.toarray()
right = slow.where('"right"').mask
values, rounds = right.astype(float), 0
while True:
    new = matrix @ values
    change = np.max(np.abs(new - values))
    values, rounds = new, rounds + 1
    if change < 1e-6:
        break
middle = values[slow.states.initial.numbers[0]]
print(f"stopped after {rounds} iterations at {middle:.7f}")
assert middle < 1e-5

# %% [markdown]
# A millionth in place of a half. (Here we iterated over all states, with the value 1 at the goal.)
# After $n$ steps, a first wave of $2^{-n}$ arrives at the middle; all later changes are as small,
# but there are millions of them. A more careful rule compares the change with the value, a
# *relative* criterion:

# %%
shorter = chain(14)
lying = shorter.with_options(certify=False, method="power").check('P=? [ F "right" ]')
print("estimate: ", lying, "after", lying.runs[0].iterations, "iterations")
print("certified:", shorter.check('P=? [ F "right" ]'))
assert 0.48 < float(lying) < 0.49
assert lying.runs[0].iterations > 90_000

# %% [markdown]
# It iterates more than 90 000 times for 29 states, and the second digit is wrong. For $n=20$ it
# stops after 774 058 iterations, at 0.194 (try it; it takes a minute). symcheck calls this an
# *estimate*; only `certify=False` asks for one. The default does not iterate here: it eliminates
# the states, and bounds the rounding errors.
#
# ## Bounds from both sides
# *Interval iteration* (Haddad and Monmege, as above) also iterates from above, from 1 on the
# unknown states. The values from above only fall, and never below the truth. So the truth lies
# between the two, always, and the iteration stops when the *gap* is small. This needs prob0 of
# lesson 3: in the chain with the state $x_1 = x_1$ there, the values from above would stay at 1 for
# ever.

# %%
money = "money=goal"
trace = teach.until_trace(gambler, "true", money, symcheck.Options(method="interval"))
print(len(trace.steps), "iterations; last width", trace.steps[-1].width)
assert trace.steps[-1].width < 1e-6

# %%
view.plot_bounds(trace.steps, state=start, truth=0.25, title="gambler: bounds for 5 euros");

# %% [markdown]
# Look at the left end: the lower bound stays at 0 for the 14 rounds in which he cannot have won,
# and the upper one begins to fall when he can be ruined, after 5. Then they approach 0.25 from both
# sides, geometrically. The width is the largest gap of all states, and now the number of
# iterations, 1227, is honest: it is what $10^{-6}$ costs.
#
# *Optimistic value iteration* (A. Hartmanns, B. L. Kaminski: Optimistic value iteration. CAV 2020,
# LNCS 12225) saves the second vector: it iterates from below, guesses an upper bound, and verifies
# the guess.
#
# ## Thresholds
# A bound in a property, such as `P>=1/6`, asks for a decision. A small error decides it wrongly if
# the value is close. *The probability of a six is 1/6. What does an estimate from below answer?*

# %%
die = symcheck.load("../models/die/die.pm")
estimate = die.with_options(certify=False, method="power").check("P=? [ F d=6 ]").value
print("estimate:", estimate, "so >= 1/6 is", estimate >= 1 / 6)
proved, refuted = die.check("P>=1/6 [ F d=6 ]"), die.check("P>1/6 [ F d=6 ]")
print("symcheck: P>=1/6 is", proved.value, "and P>1/6 is", refuted.value)
assert estimate < 1 / 6
assert proved.value
assert not refuted.value

# %% [markdown]
# symcheck narrows its bounds until they decide. Here they never will, because the value *is* the
# threshold; then it computes with fractions. This is a third way to a proved result: rational
# arithmetic, without any rounding.

# %%
exact = gambler.with_options(exact=True).check("P=? [ F money=goal ]")
print(exact)
assert str(exact.value) == "1/4"

# %% [markdown]
# ## Summary
# - Iteration from below gives the probability within $k$ steps. The change of a step says little
#   about what is still missing.
# - Three ways to a proved result: bounds from both sides; elimination with a bound on its rounding
#   errors; fractions.
# - A result must say how it was obtained. In symcheck it is *exact*, *exact up to rounding*,
#   *certified*, an *estimate*, or *statistical* (from samples).
#
# ## Exercises

# %% [markdown]
# **Exercise 1.** How does the number of iterations grow with $n$ if both bounds are iterated for
# `chain(n)`? Predict, then measure for $n = 4, 6, 8, 10$ with `teach.until_trace` and
# `method="interval"`.

# %% tags=["solution"]
lengths = []
for n in (4, 6, 8, 10):
    trace = teach.until_trace(chain(n), "true", '"right"', symcheck.Options(method="interval"))
    lengths.append(len(trace.steps))
    print(n, len(trace.steps))
assert all(3.9 < b / a < 4.7 for a, b in zip(lengths, lengths[1:]))

# %% [markdown] tags=["solution"]
# It grows fourfold when $n$ grows by two, like $2^n$: an attempt to get away from the middle
# succeeds with probability about $2^{-n}$, so so many attempts are needed. Bounds do not make
# iteration fast; they make it honest. Elimination takes each state once, however slow the chain.

# %% [markdown]
# **Exercise 2.** *Gauss–Seidel* iteration uses the new value of a state at once, in the same sweep.
# Write it for the gambler, with the same rule to stop, and count sweeps. In which order of the
# states is it faster?

# %% tags=["solution"]
def sweeps(order):
    x, count = np.zeros(len(b)), 0
    while True:
        change = 0.0
        for i in order:
            value = A[i] @ x + b[i]
            change, x[i] = max(change, value - x[i]), value
        count += 1
        if change < 1e-6:
            return count


up, down = sweeps(range(len(b))), sweeps(range(len(b) - 1, -1, -1))
print("jacobi:", iterations, " upwards:", up, " downwards:", down)
assert down < up < 0.65 * iterations

# %% [markdown] tags=["solution"]
# About half as many. Information comes from the goal, so it is a little better to begin there: one
# sweep then carries it through all states.

# %% [markdown]
# **Exercise 3.** Solve the gambler's equations exactly, with `fractions.Fraction` and Gaussian
# elimination, and compare with `exact` above.

# %% tags=["solution"]
from fractions import Fraction

n = len(b)
system = np.eye(n) - A
rows = [[Fraction(number) for number in (*system[i], b[i])] for i in range(n)]
for k in range(n):
    rows[k] = [v / rows[k][k] for v in rows[k]]
    for i in range(n):
        if i != k and rows[i][k]:
            rows[i] = [v - rows[i][k] * w for v, w in zip(rows[i], rows[k])]
assert rows[start][-1] == exact.value == Fraction(1, 4)

# %% [markdown] tags=["solution"]
# `Fraction(0.5)` is exactly 1/2. (`Fraction(0.1)` is not 1/10, so symcheck reads the numbers of a
# model as decimal fractions when it computes exactly.)
