# %% [markdown]
# # Lesson 0: A first model
# After this lesson you can write a small Markov chain in PRISM's language, ask for probabilities,
# expected values and long-run averages, simulate it, and read what symcheck says about a mistake.
#
# Time: 40 minutes. You need a little Python; you need not have seen a model checker.
#
# Run the cells in order. Several of them contain mistakes on purpose, and say so. A question in
# *italics* is for you: answer it before you run the cell below it.

# %%
from symcheck import view

# %load_ext symcheck.notebook

# %% [markdown]
# The last line makes two kinds of cells known: `%%prism NAME` holds a model and gives it a name in
# Python, and `%%pctl NAME` holds questions about it.
#
# ## A coin
# A **model** lists the situations in which a system can be, its **states**, and how it goes from
# one to the next, its **transitions**. A coin that is tossed once has three states: it is in the
# air, or it shows heads, or tails.

# %%
# %%prism coin
# dtmc
#
# module toss
#   side : [0..2] init 0;  // 0: in the air, 1: heads, 2: tails
#
#   [] side=0 -> 0.5 : (side'=1) + 0.5 : (side'=2);
#   [] side>0 -> true;
# endmodule

# %% [markdown]
# Unfold the text below the cell to see it in colours. Line by line:
#
# - `dtmc` is the type of the model: a *discrete-time Markov chain*, which moves in steps.
# - `module toss … endmodule` is a component. The model may have several.
# - `side : [0..2] init 0;` declares a **variable**: a whole number from 0 to 2, at first 0. A state
#   is a value for each variable.
# - A **command** is `[] guard -> updates;`. It may happen where its *guard* is true. Its updates
#   are separated by `+`; each has a probability, a colon, and assignments in parentheses.
# - `(side'=1)` says that the *next* value of `side` is 1. The prime belongs to the new value; in
#   the guard and on the right of `=` stand old values.
# - `true` as an update changes nothing: once the coin has landed, it lies there for ever.
#
# In the picture, each box is a state, the initial one has a thick border, and each arrow has its
# probability.

# %%
view.state_graph(coin)

# %% [markdown]
# ## Questions
# A **property** is a question about all paths through the model at once. `P=? [ … ]` asks how
# probable it is that a path does what the brackets say. `F` (*finally*, or eventually) means: now
# or at some later step. `X` (*next*) means: after exactly one step.
#
# *Which of these four answers do you know already? Is `F side>0` certain?*

# %%
# %%pctl coin -r found
# P=? [ F side=1 ];
# P=? [ F side>0 ];
# P=? [ X side=1 ];
# P>=0.5 [ F side=1 ]

# %% [markdown]
# The table has one row per question. With a threshold, as in `P>=0.5`, the answer is true or false.
# The columns *accuracy* and *bounds* tell how far you can trust a number: the true value lies
# between the two bounds. (Floating-point numbers cannot say whether a value that lies *on* a
# threshold reaches it, so symcheck decided the last question with fractions, as its note says.)
#
# `-r found` keeps the results, in this order, in a Python variable:

# %%
assert abs(float(found[0]) - 0.5) < 1e-12
assert float(found[1]) == 1
assert bool(found[3])
found[0]

# %% [markdown]
# ## Mistakes, and what they look like
# Everybody forgets a semicolon. This text has a mistake; *find it before you run the cell.*

# %% tags=["raises-exception"]
# %%prism wrong
# dtmc
# module toss
#   side : [0..2] init 0
#   [] side=0 -> 0.5 : (side'=1) + 0.5 : (side'=2);
#   [] side>0 -> true;
# endmodule

# %% [markdown]
# A message has the name of the model, the line and the column in the cell, what is wrong, the place
# underlined, and a hint. Here is another mistake that is easily made:

# %% tags=["raises-exception"]
# %%prism wrong
# dtmc
# module toss
#   side : [0..2] init 0;
#   [] side=0 -> 0.5 : side=1 + 0.5 : side=2;
#   [] side>0 -> true;
# endmodule

# %% [markdown]
# Some faults can only be seen in states, and symcheck looks at states when you ask something. The
# next cell is accepted, and the one after it is not. *Why can the first one not know?* (Guards may
# exclude the states in which a command would be wrong, so the states must be found first.)

# %%
# %%prism wrong
# dtmc
# module toss
#   side : [0..2] init 0;
#   [] side=0 -> 0.5 : (side'=1) + 0.4 : (side'=2);
#   [] side>0 -> true;
# endmodule

# %% tags=["raises-exception"]
# %%pctl wrong
# P=? [ F side=1 ]

# %% [markdown]
# The third kind is a **warning**: the model means something, but probably not what you want. This
# one has two. Its label names states that do not exist, and it has no command for a coin that has
# landed.

# %%
# %%prism stuck
# dtmc
# module toss
#   side : [0..2] init 0;
#   [] side=0 -> 0.5 : (side'=1) + 0.5 : (side'=2);
# endmodule
# label "edge" = side=3;

# %%
for warning in (*stuck.warnings, *stuck.state_warnings):
    print(warning)

# %% [markdown]
# A state in which nothing can happen is a **deadlock**. symcheck lets the system stay there, which
# is right for the coin. In a larger model, a deadlock is often a case that you forgot; write
# `[] … -> true;` where you mean it, so that a warning always means something. `model.warnings`
# needs the text only, `model.state_warnings` the states.
#
# ## A game: two heads in a row
# Toss a coin until it shows heads twice in a row. What do we have to remember? Not all tosses: only
# how many heads came last. That is the art of modelling: **a state is what matters for the
# future.**

# %%
# %%prism game
# dtmc
#
# module toss
#   heads : [0..2] init 0;  // heads in a row
#
#   [] heads<2 -> 0.5 : (heads'=heads+1) + 0.5 : (heads'=0);
#   [] heads=2 -> true;
# endmodule
#
# label "won" = heads=2;
#
# rewards "tosses"
#   heads<2 : 1;
# endrewards

# %% [markdown]
# Two things are new. A **label** is a name for states, and stands in quotes in properties. A
# **reward** counts something: each step that leaves a state with `heads<2` counts 1, a toss.
# `R{"tosses"}=? [ F "won" ]` asks how many are counted on average until the game is won. `F<=6`
# means: within six steps.
#
# *The first two tosses win with probability 1/4. So are four tosses enough on average? Guess.*

# %%
# %%pctl game -r found
# P=? [ F "won" ];
# P=? [ F<=6 "won" ];
# R{"tosses"}=? [ F "won" ]

# %%
assert abs(float(found[2]) - 6) < 1e-9
found[2].values

# %% [markdown]
# Six, and the values of the other states explain it. Let $e_0$ and $e_1$ be the expected numbers of
# tosses from 0 and from 1 heads. One toss is made, and then we are somewhere else:
# $e_0 = 1 + \frac{1}{2} e_1 + \frac{1}{2} e_0$ and $e_1 = 1 + \frac{1}{2} e_0$. Put $e_0=6$ and
# $e_1=4$ in. Lesson 3 solves such equations.
#
# ## A value that changes: experiments and plots
# A property may have constants of its own. With a range (`k=0:20`) it is checked for each value:

# %%
# %%pctl game k=0:20 -r curve
# const int k;
# P=? [ F<=k "won" ]

# %%
curve.plot();

# %% [markdown]
# Look for two things: the curve is 0 until `k` is 2, and it approaches 1, but never gets there. For
# each `k` there is a small chance that the game goes on; that it goes on *for ever* has probability
# 0.
#
# ## Simulation
# A simulator takes random steps. It shows what a model does, and finds mistakes early:

# %%
print(game.simulate(12, seed=1))

# %% [markdown]
# A row is a step: the action (a command without a name shows its module), the number of the step,
# and the values after it. The path ends before step 12, because nothing can change any more. Many
# paths give an estimate, with an interval that contains the value in 99 of 100 such experiments:

# %%
estimate = game.estimate('P=? [ F<=6 "won" ]', samples=10_000, seed=1)
print(estimate)
print("computed:", found[1])

# %% [markdown]
# The computed value is 43/64. The estimate has two correct digits after 10 000 paths; a further
# digit takes a hundred times as many. This is why this course is about computing.
#
# ## A queue
# Customers wait for a clerk. In each step a customer comes with probability 0.3, or one is served
# with probability 0.4, or nothing happens. `const int N;` is a constant without a value: how many
# can wait. *What is wrong with this model?*

# %%
# %%prism queue N=6
# dtmc
# const int N;
# module counter
#   n : [0..N] init 0;
#   [] true -> 0.3 : (n'=n+1) + 0.4 : (n'=n-1) + 0.3 : true;
# endmodule

# %% tags=["raises-exception"]
# %%pctl queue
# S=? [ n=N ]

# %% [markdown]
# An empty queue serves nobody. Somebody mends it with a command for each event:

# %%
# %%prism queue N=6
# dtmc
# const int N;
# module counter
#   n : [0..N] init 0;
#   [] n<N -> 0.3 : (n'=n+1) + 0.7 : true;
#   [] n>0 -> 0.4 : (n'=n-1) + 0.6 : true;
# endmodule

# %%
# %%pctl queue -r overlapping
# S=? [ n=N ]

# %% [markdown]
# `S=?` asks for the share of the time in the long run. There is an answer, but read the line below
# the table. In state 1 *both* commands may happen, and a `dtmc` then tosses a coin between them: a
# customer comes with probability 0.15 there, not 0.3. Guards must exclude each other:

# %%
# %%prism queue
# dtmc
# const int N;
#
# module counter
#   n : [0..N] init 0;
#
#   [] n=0         -> 0.3 : (n'=n+1)                   + 0.7 : true;
#   [] n>0 & n<N   -> 0.3 : (n'=n+1) + 0.4 : (n'=n-1) + 0.3 : true;
#   [] n=N         -> 0.4 : (n'=n-1)                   + 0.6 : true;
# endmodule
#
# label "full" = n=N;
#
# rewards "length"
#   true : n;
# endrewards

# %%
# %%pctl queue N=6 -r found
# S=? [ "full" ];
# R{"length"}=? [ S ];
# P=? [ F<=100 "full" ]

# %%
assert float(overlapping[0]) < 0.04 < 0.05 < float(found[0]) < 0.06

# %% [markdown]
# The wrong model says that the queue is full for 3 % of the time; it is more than 5 %. A warning is
# worth reading.
#
# The model above has no value for `N`; the cell of questions gave one. In Python, `with_constants`
# does. Here is the share of the time of each state, first after ten steps, then in the long run.
# *Which states lose probability between the two pictures?*

# %%
six = queue.with_constants("N=6")
six.transient(10).plot().set_title("after ten steps");

# %%
six.steady_state().plot().set_title("in the long run");

# %% [markdown]
# The queue starts empty, so early on it is shorter than later: states 0 to 2 lose, the longer
# queues gain. In the long run, each bar is three quarters of the one before it. (0.3/0.4: as often
# as the queue grows from $n$ to $n+1$, it shrinks back.)

# %%
early = six.transient(10).to_frame().probability
shares = six.steady_state().to_frame().probability
assert all(abs(b / a - 0.75) < 1e-9 for a, b in zip(shares, shares[1:]))
assert [bool(gains) for gains in shares > early] == [False] * 3 + [True] * 4

# %% [markdown]
# ## Two modules
# Now the clerk takes breaks. A second module says when. A command with a name in its brackets, an
# **action**, happens *together* with the commands of the same action in the other modules; here,
# all of them move at each `tick`, and their probabilities are multiplied. A `formula` is a name for
# an expression, and probabilities may be expressions:

# %%
# %%prism office
# dtmc
# const int N = 6;
# formula serve = here ? 0.4 : 0;
#
# module counter
#   n : [0..N] init 0;
#
#   [tick] n=0       -> 0.3 : (n'=n+1) + 0.7 : true;
#   [tick] n>0 & n<N -> 0.3 : (n'=n+1) + serve : (n'=n-1) + 0.7-serve : true;
#   [tick] n=N       -> serve : (n'=n-1) + 1-serve : true;
# endmodule
#
# module clerk
#   here : bool init true;
#
#   [tick] here  -> 0.05 : (here'=false) + 0.95 : true;
#   [tick] !here -> 0.20 : (here'=true)  + 0.80 : true;
# endmodule
#
# label "full" = n=N;

# %% [markdown]
# *How many states has it? For which part of the time is the clerk away?* (A stay lasts 20 steps on
# average, a break 5.)

# %%
# %%pctl office -r found
# S=? [ "full" ];
# S=? [ !here ]

# %%
print(len(office.states), "states")
assert len(office.states) == 7 * 2
assert abs(float(found[1]) - 0.2) < 1e-9
assert 2.5 < float(found[0]) / six.check('S=? [ "full" ]').value < 3

# %% [markdown]
# A fifth of the time without a clerk makes the queue full almost three times as often. No part of
# the model says so: it follows from both together, and that is what one builds models for.
#
# ## Summary
# - A state is a value for each variable; commands have guards, and updates with probabilities.
# - `P` asks for a probability, `R` for an expected reward, `S` for a share of the time in the long
#   run; `F`, `F<=k` and `X` describe paths.
# - Errors stop you; warnings do not, so read them.
# - The language is that of PRISM; `docs/modelling.md` in this repository has more of it. (M.
#   Kwiatkowska, G. Norman, D. Parker: PRISM 4.0: Verification of probabilistic real-time systems.
#   CAV 2011, LNCS 6806, pp. 585–591).
#
# ## Exercises
# Write your models in cells of your own; `b` in Jupyter's command mode adds one.

# %% [markdown]
# **Exercise 1.** Play for `K` heads in a row, where `K` is a constant. How many tosses does it take
# on average for `K` = 1 to 6? Find the rule.

# %% tags=["solution"]
# %%prism row
# dtmc
# const int K;
# module toss
#   heads : [0..K] init 0;
#   [] heads<K -> 0.5 : (heads'=heads+1) + 0.5 : (heads'=0);
#   [] heads=K -> true;
# endmodule
# rewards "tosses"
#   heads<K : 1;
# endrewards

# %% tags=["solution"]
# %%pctl row K=1:6 -r tosses
# R{"tosses"}=? [ F heads=K ]

# %% [markdown] tags=["solution"]
# 2, 6, 14, 30, 62, 126: each is twice the one before and two more, $2^{K+1}-2$. For one more head
# you need the tosses up to there and one more; and with probability 1/2 you start again.

# %% tags=["solution"]
assert [round(row.value, 6) for row in tosses.rows] == [2 ** (k + 1) - 2 for k in range(1, 7)]

# %% [markdown]
# **Exercise 2.** Your coin shows heads with probability `p`, which nobody knows. John von Neumann's
# trick makes a fair coin of it (Various techniques used in connection with random digits. NBS
# Applied Mathematics Series 12, 1951, pp. 36–38): toss twice; *heads, tails* counts as heads,
# *tails, heads* as tails, and otherwise begin again. Model it, and check for several `p` that it is
# fair. How many tosses does it need on average?

# %% tags=["solution"]
# %%prism neumann
# dtmc
# const double p;
# module twice
#   // 0: before the first toss, 1: heads first, 2: tails first, 3: heads, 4: tails
#   s : [0..4] init 0;
#   [] s=0 -> p : (s'=1) + 1-p : (s'=2);
#   [] s=1 -> p : (s'=0) + 1-p : (s'=3);
#   [] s=2 -> p : (s'=4) + 1-p : (s'=0);
#   [] s>2 -> true;
# endmodule
# rewards "tosses"
#   s<3 : 1;
# endrewards

# %% tags=["solution"]
# %%pctl neumann p=0.1:0.2:0.9 -r trick
# P=? [ F s=3 ];
# R{"tosses"}=? [ F s>=3 ]

# %% [markdown] tags=["solution"]
# Both results of a pair have probability $p(1-p)$, so the coin is fair. A pair ends the game with
# probability $2p(1-p)$, and costs two tosses: $1/(p(1-p))$ on average.

# %% tags=["solution"]
chances, costs = trick.rows[::2], trick.rows[1::2]
assert all(abs(row.value - 0.5) < 1e-9 for row in chances)
for row, p in zip(costs, (0.1, 0.3, 0.5, 0.7, 0.9)):
    assert abs(row.value - 1 / (p * (1 - p))) < 1e-6

# %% [markdown]
# **Exercise 3.** This traffic light has four mistakes. Copy the text into a cell, and mend it until
# symcheck has nothing to say. Green lasts five steps on average, yellow one, red four.
# ```
# dtmc
# module light
#   colour : [0..2] init 0  // 0: green, 1: yellow, 2: red
#   [] colour=0 -> 0.2 : (colour'=1) + 0.7 : true;
#   [] colour=1 -> colour'=2;
#   [] colour>=1 -> 0.25 : (colour'=0) + 0.75 : true;
# endmodule
# ```

# %% [markdown] tags=["solution"]
# A semicolon after `init 0`, 0.8 for 0.7, parentheses around `colour'=2`, and `colour=2` in the
# last guard, which overlaps with the one above it.

# %% tags=["solution"]
# %%prism light
# dtmc
# module light
#   colour : [0..2] init 0;  // 0: green, 1: yellow, 2: red
#   [] colour=0 -> 0.2 : (colour'=1) + 0.8 : true;
#   [] colour=1 -> (colour'=2);
#   [] colour=2 -> 0.25 : (colour'=0) + 0.75 : true;
# endmodule

# %% tags=["solution"]
# %%pctl light -r green
# S=? [ colour=0 ]

# %% tags=["solution"]
assert not light.warnings
assert not light.state_warnings
assert abs(float(green[0]) - 0.5) < 1e-9  # 5 of 10 steps

# %% [markdown]
# **Exercise 4.** Customers who come when the queue is full go away. How many are lost per step in
# the long run, with `N=6`? Add a reward to `queue`, and ask `R{"lost"}=? [ S ]`.

# %% [markdown] tags=["solution"]
# In a full queue, a customer comes with probability 0.3 in each step, so the reward of these states
# is 0.3: the expected loss of one step.

# %% tags=["solution"]
# %%prism losing N=6
# dtmc
# const int N;
# module counter
#   n : [0..N] init 0;
#   [] n=0         -> 0.3 : (n'=n+1)                   + 0.7 : true;
#   [] n>0 & n<N   -> 0.3 : (n'=n+1) + 0.4 : (n'=n-1) + 0.3 : true;
#   [] n=N         -> 0.4 : (n'=n-1)                   + 0.6 : true;
# endmodule
# rewards "lost"
#   n=N : 0.3;
# endrewards

# %% tags=["solution"]
# %%pctl losing -r lost
# R{"lost"}=? [ S ]

# %% tags=["solution"]
assert abs(float(lost[0]) - 0.3 * six.check('S=? [ "full" ]').value) < 1e-9
