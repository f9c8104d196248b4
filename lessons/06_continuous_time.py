# %% [markdown]
# # Lesson 6: Continuous time and uniformisation
# After this lesson you can compute transient and steady-state distributions of a CTMC by hand, and
# say what the truncation of a Poisson sum costs.
#
# Time: 40 minutes. You need lesson 3.
#
# The theory is in C. Baier, B. Haverkort, H. Hermanns and J.-P. Katoen, *Model-checking algorithms
# for continuous-time Markov chains*, IEEE Transactions on Software Engineering 29(6), 2003, and in
# section 4 of M. Kwiatkowska, G. Norman and D. Parker, *Stochastic model checking*, SFM 2007.

# %% [markdown]
# ## A queue
# Customers arrive at a queue at random, 1.5 per unit of time on average. One server serves them, 2
# per unit of time on average. There is room for 10 customers; who arrives at a full queue goes
# away. This is the M/M/1/K queue of L. Kleinrock, *Queueing Systems*, volume 1, Wiley 1975, section
# 3.6.

# %%
from math import exp

import numpy as np
import symcheck
from symcheck import view

queue = symcheck.load("../models/queue/queue.sm")
print(open("../models/queue/queue.sm").read())

# %% [markdown]
# The picture shows the states near the empty queue. The number at an edge is a *rate*, not a
# probability: rates are positive numbers, and those of a state need not sum to 1. The states that
# are left out, up to `n=10`, go on in the same way.

# %%
view.state_graph(queue, around="n=0", radius=3)

# %% [markdown]
# ## Rates
# A transition with rate $r$ happens after a random time with the exponential distribution: it has
# not happened by time $t$ with probability $e^{-rt}$. In a state with several transitions all of
# them run, and the first one wins the race. Two facts about exponential distributions make this
# simple:
#
# - The minimum of two exponential times with rates $a$ and $b$ is exponential with rate $a+b$. So a
#   state $s$ is left at its **exit rate** $E(s)$, the sum of its rates, and is kept $1/E(s)$ on
#   average.
# - The one with rate $a$ wins with probability $a/(a+b)$, and how long the race took says nothing
#   about who won.
#
# *Before you run the next cell:* one customer is in the queue. What is the probability that another
# one arrives before this one is served? What is it in the empty queue?

# %%
R = queue.matrix.toarray()  # R[s, t] is the rate from s to t
E = R.sum(axis=1)
print("exit rates:", E)
print("an arrival comes first, from n=1:", R[1, 2] / E[1], " and from n=0:", R[0, 1] / E[0])
assert np.isclose(R[1, 2] / E[1], 3 / 7)
assert np.isclose(queue.check("filter(state, P=? [ X n=2 ], n=1)").value, 3 / 7)

# %% [markdown]
# `X` looks at the next jump only, whenever it happens. So properties without time ask about the
# *embedded* chain with the probabilities $R(s,t)/E(s)$, and lesson 3 answers them. What is new is
# the question *when*.
#
# ## The generator
# Let $\pi(t)$ be the row vector of the probabilities of the states at time $t$. In a short time
# $h$, a state $s$ loses about $h\,E(s)$ of its probability, and gives $h\,R(s,t)$ of it to state
# $t$. With the **generator** $Q = R - \mathrm{diag}(E)$ this is Kolmogorov's forward equation
# $\pi'(t) = \pi(t)\,Q$, whose solution is $\pi(t) = \pi(0)\,e^{Qt}$. Look at the corner of $Q$:
# each row sums to 0, because what a state loses, others get.

# %%
Q = R - np.diag(E)
assert np.allclose(Q.sum(axis=1), 0)
Q[:4, :4]

# %% [markdown]
# The sum $\sum_k (Qt)^k/k!$ defines the matrix exponential, but it is a bad recipe: the entries of
# $Q$ have both signs, so large terms cancel, and rounding is left.
#
# ## Uniformisation
# Uniformisation (A. Jensen, *Markoff chains as an aid in the study of Markoff processes*,
# Skandinavisk Aktuarietidskrift 36, 1953) avoids negative numbers. Let a clock tick with a rate $q$
# that is at least as large as all exit rates. At each tick, state $s$ moves to $t$ with probability
# $R(s,t)/q$. With the probability that remains, $1 - E(s)/q$, it stays where it is. A state with a
# small exit rate simply ignores many ticks. So the ticks have the same rate in every state, and the
# moves are those of a DTMC with the matrix $P = I + Q/q$.
#
# *Before you run the cell:* which states of the queue have a self-loop in $P$ if $q = 3.5$?

# %%
q = E.max()
P = np.eye(len(R)) + Q / q
assert np.allclose(P.sum(axis=1), 1)
assert (P >= 0).all()
print("q =", q)
print("self-loops:", P.diagonal().round(3))
P[:4, :4].round(3)

# %% [markdown]
# Only the first and the last state ignore ticks: in the empty queue nobody is served, and at the
# full one nobody enters.
#
# Where is the chain at time $t$? The number of ticks until then has the Poisson distribution with
# mean $qt$. If it is $k$, the chain has made $k$ steps of $P$. Summing over $k$ gives
#
# $$\pi(t) = \sum_{k=0}^{\infty} \underbrace{e^{-qt}\,\frac{(qt)^k}{k!}}_{\text{weight } w_k}\; \pi(0)\,P^k .$$
#
# All terms are positive. The weights come one from the other, $w_0 = e^{-qt}$ and
# $w_k = w_{k-1}\,qt/k$:


# %%
def weights(mean, error):
    """The first Poisson probabilities, until those that are left sum to less than `error`."""
    found = [exp(-mean)]
    while sum(found) < 1 - error:
        found.append(found[-1] * mean / len(found))
    return found


for k, weight in enumerate(weights(q * 1.0, 0.01)):
    print(f"{k} ticks: {weight:.4f}", "#" * round(100 * weight))

# %% [markdown]
# The weights rise until $k \approx qt = 3.5$ and then fall faster than any geometric sequence. Nine
# of them hold 99 % of the sum. The rest is left out.
#
# The distribution at time $t$ is now a loop: `state` is $\pi(0)P^k$, and each turn adds it with its
# weight.


# %%
def transient(t, error=1e-10):
    state = np.zeros(len(R))
    state[queue.states.initial.numbers] = 1
    result = np.zeros(len(R))
    found = weights(q * t, error)
    for weight in found:
        result += weight * state
        state = state @ P
    return result, len(found)


mine, terms = transient(1.0)
print(terms, "terms;", mine[:4].round(6))
theirs = queue.transient(1.0).to_frame().probability
assert np.allclose(mine, theirs)

# %% [markdown]
# The last line compares all eleven numbers with those of symcheck. At time 1 the queue, which began
# empty, is empty with a probability of nearly one half.
#
# ## What the truncation costs
# If we stop when the weights that we have sum to $1-\varepsilon$, we lose
# $\sum_{k \text{ left out}} w_k\,\pi(0)P^k$. This is a vector of numbers that are not negative, and
# they sum to the weights left out, at most $\varepsilon$. So the result is a **lower** bound in
# each state, and the sum of all errors is known: it is what is missing to 1. This is an error bound
# *before* we know the value, which value iteration (lesson 4) did not have.
#
# *Before you run the cell:* how many more terms do you expect for an error of $10^{-12}$ instead of
# $10^{-3}$: four times as many, or fewer?

# %%
exact = transient(1.0, 1e-14)[0]
for error in (1e-1, 1e-3, 1e-6, 1e-9, 1e-12):
    rough, terms = transient(1.0, error)
    missing, largest = 1 - rough.sum(), (exact - rough).max()
    print(f"{error:.0e}: {terms:2} terms, missing {missing:.1e}, largest error {largest:.1e}")
    assert (rough <= exact + 1e-15).all()
    assert largest <= error

# %% [markdown]
# Twice as many terms divide the error by a thousand millions. Precision is cheap. What is expensive
# is a large $qt$: you need about $qt$ terms to get to the top of the weights at all. There is a
# second danger. For $qt > 745$, the double $e^{-qt}$ is 0, and our recursion would never leave 0.
# B. L. Fox and P. W. Glynn (*Computing Poisson probabilities*, Communications of the ACM 31, 1988)
# start at the largest weight and go to both sides.
#
# ## Properties of time
# `P=? [ F<=t n=10 ]` is the probability that the queue is full *at some moment* until $t$. The
# distribution at time $t$ does not answer this: the queue may have been full and have become
# shorter again. The trick is to make the goal absorbing. Then "was there" and "is there" are the
# same, and the transient distribution is the answer (Baier et al. 2003, the bounded until).
#
# The next cell deletes the row of `n=10` and repeats the sum for $t = 20$.

# %%
absorbing = P.copy()
absorbing[10] = 0
absorbing[10, 10] = 1  # every tick is ignored
state, was_full = np.eye(11)[0], 0.0
for weight in weights(q * 20, 1e-10):
    was_full += weight * state[10]
    state = state @ absorbing
checked = queue.check("P=? [ F<=20 n=10 ]")
print("full at some moment until 20:", was_full, "| symcheck:", checked)
print("full at time 20:             ", transient(20)[0][10])
assert abs(was_full - float(checked)) < 1e-9

# %% [markdown]
# The first probability is nearly nine times the second. In symcheck, the result says `certified`,
# with the error that is left. `runs` tells how it was computed: symcheck bounds the terms that are
# left from both sides, and stops as soon as these bounds are close enough. So it made fewer steps
# than its window of Poisson weights has.
#
# *Before you run the next cell:* is the probability for $t=10$ half of that for $t=20$?

# %%
print(checked.runs[0].explanation)
for t in (1, 2, 5, 10, 20):
    print(t, f"{queue.check(f'P=? [ F<={t} n=10 ]'):.6f}")
assert 8.5 < was_full / transient(20)[0][10] < 9

# %% [markdown]
# It is less than a third: the queue begins empty and needs time to fill.
#
# ## The long run
# The queue forgets how it began: $\pi(t)$ approaches the **steady state** $\pi$, which no longer
# changes, so $\pi Q = 0$. One of these equations follows from the others, and $\sum_s \pi_s = 1$
# takes its place. Here all are put one below the other, and least squares solves them.

# %%
system = np.vstack([Q.T, np.ones(len(Q))])
right_side = np.append(np.zeros(len(Q)), 1)
steady = np.linalg.lstsq(system, right_side, rcond=None)[0]
steady.round(4)

# %% [markdown]
# For this queue there is a formula. In the long run, the queue passes from $n$ to $n+1$ as often as
# back, so $1.5\,\pi_n = 2\,\pi_{n+1}$: the steady state is geometric with ratio $\rho = 0.75$, and
# what remains is to divide by the sum.

# %%
rho = 1.5 / 2
closed = rho ** np.arange(11) * (1 - rho) / (1 - rho**11)
assert np.allclose(steady, closed)
print(queue.check("S=? [ n=0 ]"), "|", closed[0])

# %% [markdown]
# How soon is the long run? Look at how the distance to the steady state falls.

# %%
for t in (1, 5, 10, 20, 40, 80):
    at_t, _ = transient(t)
    print(f"t={t:2}: empty {at_t[0]:.6f}, distance {abs(at_t - steady).sum():.1e}")

# %% [markdown]
# From $t=20$ on, twice the time squares the error, roughly: it falls exponentially. Once
# $\pi(0)P^k$ hardly changes with $k$, further terms add nothing new, and nobody has to compute
# them.
#
# ## Stiff chains
# A chain is *stiff* if it has very fast and very slow rates. The clock of uniformisation has to
# tick for the fastest transition, while one waits for the slowest. In `polling.sm`, a server walks
# between stations with rate 200, and a job arrives with rate 0.25.
#
# `F=t job1` asks for a job at station 1 at time $t$.
#
# *Before you run the cell:* how many terms does the plain sum need for $t=1000$?

# %%
polling = symcheck.load("../models/polling/polling.sm")
fastest = polling.matrix.sum(axis=1).max()
for t in (1, 10, 100, 1000):
    result = polling.check(f"P=? [ F={t} job1 ]")
    print(f"t={t:4}, qt={fastest * t:8.0f}: {result.value:.8f} by {result.runs[0].explanation}")
long_run = polling.check("S=? [ job1 ]")
print("in the long run:", long_run)
assert result.bounds[0] <= long_run.value <= result.bounds[1]

# %% [markdown]
# The plain sum needs somewhat more than $qt = 201\,000$ terms. symcheck stops when the vector is
# steady, after fewer than 7 000 steps, and says so in `runs`. From $t=100$ on the value is that of
# the long run within the certified error.
#
# ## Summary
# - Transitions race; a state is left at its exit rate, and $R(s,t)/E(s)$ is the probability that
#   $t$ is next.
# - Uniformisation turns a CTMC into a DTMC whose steps happen at the ticks of a Poisson clock of
#   rate $q \ge \max E$.
# - The truncated sum is a lower bound, and the missing weight bounds its error; about $qt$ plus
#   some multiples of $\sqrt{qt}$ terms are needed.
# - A bounded until is a transient probability after the goal has been made absorbing.
# - The steady state solves $\pi Q = 0$, $\sum \pi = 1$.

# %% [markdown]
# ## Exercises

# %% [markdown]
# **Exercise 1.** How many terms does `transient` need for $t = 1, 10, 100$? Relate the number to
# $qt$ and to $\sqrt{qt}$, the standard deviation of the number of ticks.

# %% [markdown] tags=["solution"]
# The number is $qt$ plus a multiple of the standard deviation, between 6 and 10 times it: for an
# error of $10^{-10}$, a normal distribution needs 6.4 standard deviations, and a Poisson
# distribution with a small mean has a longer tail. So for large $t$, the number divided by $qt$
# approaches 1.

# %% tags=["solution"]
for t in (1, 10, 100):
    terms, mean = transient(t)[1], q * t
    print(f"t={t}: {terms} terms = {mean} + {(terms - mean) / mean**0.5:.1f} * sqrt({mean})")
    assert 6 < (terms - mean) / mean**0.5 < 10

# %% [markdown]
# **Exercise 2.** Compute the expected number of customers at time 1, `R{"length"}=? [ I=1 ]`, from
# your distribution.

# %% [markdown] tags=["solution"]
# The mean of the distribution, as state number $n$ has $n$ customers:

# %% tags=["solution"]
mean = mine @ np.arange(11)
assert np.isclose(mean, float(queue.check('R{"length"}=? [ I=1 ]')))
print(mean)

# %% [markdown]
# **Exercise 3.** Estimate `P=? [ F<=5 n=10 ]` from 10 000 random paths
# (`queue.estimate(…, samples=10_000, seed=1)`), and compare the confidence interval with the
# certified value. How many paths would you need for an interval that is ten times as narrow?

# %% [markdown] tags=["solution"]
# The interval holds the value here; over many experiments it does so in at least 99 of 100. Its
# width falls with the square root of the number of paths, so a tenth of the width needs a hundred
# times as many: a million. Uniformisation gives twelve digits with 50 steps.

# %% tags=["solution"]
estimate = queue.estimate("P=? [ F<=5 n=10 ]", samples=10_000, seed=1)
value = queue.check("P=? [ F<=5 n=10 ]")
print(estimate)
print(value, "by", value.runs[0].explanation)
assert estimate.bounds[0] <= float(value) <= estimate.bounds[1]

# %% [markdown]
# **Exercise 4.** Repeat `transient` with $q = 10$ and with $q = 2$. Which results are right, and
# what has changed? Explain.

# %% [markdown] tags=["solution"]
# Every $q \ge 3.5$ gives the same distribution: a faster clock has more ticks, and the states
# ignore more of them. It only costs more terms. With $q = 2$, the self-loops have the probability
# $1 - 3.5/2 < 0$, so $P$ is no longer stochastic. The sum is still $e^{Qt}$ in exact arithmetic,
# because nothing in the algebra needs $q \ge \max E$. But terms of both signs cancel, and a
# truncated sum is no lower bound any more.

# %% tags=["solution"]
for rate in (3.5, 10, 2):
    matrix = np.eye(11) + Q / rate
    state, result, found = np.eye(11)[0], np.zeros(11), weights(rate, 1e-10)
    for weight in found:
        result += weight * state
        state = state @ matrix
    difference = abs(result - mine).max()
    print(
        f"q={rate}: {len(found)} terms, least entry of P {matrix.min():.2f}, {difference:.0e} off"
    )
