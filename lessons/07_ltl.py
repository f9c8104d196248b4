# %% [markdown]
# # Lesson 7: LTL and the product with an automaton
# After this lesson you can turn a question about whole paths into a deterministic automaton, build
# its product with a chain, and reduce it to reachability.
#
# Time: 40 minutes. You need lessons 3 and 5.
#
# C. Baier and J.-P. Katoen, *Principles of Model Checking*, MIT Press 2008, have the theory: LTL in
# section 5.1, automata on infinite words in 4.3, their product with chains in 10.3, and decision
# processes in 10.6. The idea is due to M. Y. Vardi (*Automatic verification of probabilistic
# concurrent finite-state programs*, FOCS 1985) and C. Courcoubetis and M. Yannakakis (*The
# complexity of probabilistic verification*, Journal of the ACM 42, 1995).

# %%
from itertools import product as combinations
from typing import NamedTuple

import networkx
import symcheck
from symcheck import view

die = symcheck.load("../models/die/die.pm")
view.state_graph(die)

# %% [markdown]
# ## Questions about paths
# The graph above is the die of Knuth and Yao: each of the inner states tosses a coin, and `d` is
# the result. So far we asked whether a path *reaches* some state. **LTL** (linear temporal logic)
# says more about a path. Its operators are
#
# | formula | holds at a position of a path if |
# |---|---|
# | `X f` | `f` holds at the next position |
# | `F f`, `G f` | `f` holds at some position from here on; at all of them |
# | `f U g` | `g` holds at some position from here on, and `f` at all before it |
# | `G F f` | `f` holds again and again, infinitely often |
# | `F G f` | `f` holds from some position on, for ever |
#
# A formula holds on a path or it does not. `P=? [ f ]` is the probability of the paths on which it
# holds.
#
# *Before you run the next cell:* find both values in the graph. What is the probability that the
# first toss leads to `s=2` and the result is not 6? And how often does a path visit `d=6` that
# reaches it?

# %%
mixed = die.check("P=? [ (F s=2) & (G d!=6) ]")
print(mixed)
print(die.check("P=? [ G F d=6 ]"))
assert abs(float(mixed) - 1 / 3) < 1e-12

# %% [markdown]
# `s=2` comes first with probability 1/2, and then 4, 5 and 6 are equally likely, so the first value
# is $\frac12\cdot\frac23$. The second is that of `F d=6`, because the result is never left.
#
# ## An automaton
# The first formula talks about *two* events of a path. In general the present state does not tell
# whether something happened in the past, so somebody has to remember it. A **deterministic
# automaton** is this memory. It reads the states of the path one by one, and has for each memory
# and each state read exactly one next memory.
#
# What has to be remembered for `(F s=2) & (G d!=6)`? If `d=6` was seen, all is lost for ever;
# otherwise it matters whether `s=2` was seen. Three memories are enough:

# %%
NOTHING, SEEN_2, LOST = 0, 1, 2


def read(memory, state):
    if memory == LOST or state["d"] == 6:
        return LOST
    if state["s"] == 2:
        return SEEN_2
    return memory


letters = {"s=2": {"s": 2, "d": 0}, "d=6": {"s": 7, "d": 6}, "other": {"s": 3, "d": 0}}
for memory in (NOTHING, SEEN_2, LOST):
    print(f"memory {memory}:", {name: read(memory, state) for name, state in letters.items()})

# %% [markdown]
# Look along the rows: memory 2 is never left, and memory 1 only towards 2.
#
# A path is infinite, so there is no last memory that could decide. Acceptance is a condition on the
# memories that occur *infinitely often*. Here a path satisfies the formula if it stays in memory 1
# from some time on.
#
# ## The product
# A state of the **product** is a pair: a state of the chain, with the memory *after* it has been
# read. The chain moves with its probabilities, and the automaton follows. It has no choice, so it
# adds no probability of its own: paths of the chain and paths of the product correspond one to one,
# with the same probabilities.
#
# We build it in two steps. First we list the moves of the chain:

# %%
moves = {state: [] for state in die.states}
for source, _, target, probability in die.transitions:
    moves[source].append((probability, target))
moves[die.states[0]]

# %% [markdown]
# Second, `symcheck.from_function` explores a model from an initial state and a function that gives
# the successors of a state. The fields of the named tuple become variables of the product. `pair`
# lets the automaton read a state of the die; `step` takes each move of the die from there. Note that
# the initial state is read as well, before anything moves.


# %%
class Pair(NamedTuple):
    s: int
    d: int
    memory: int


def product(read, start=0):
    def pair(state, memory):
        return Pair(state["s"], state["d"], read(memory, state))

    def step(now):
        state = die.states[{"s": now.s, "d": now.d}]
        return [(probability, pair(target, now.memory)) for probability, target in moves[state]]

    return symcheck.from_function(pair(die.states[0], start), step)


both_events = product(read)
print(len(die.states), "states of the chain,", len(both_events.states), "of the product")
view.state_graph(both_events)

# %% [markdown]
# There are $13 \cdot 3 = 39$ pairs, but only 13 can be reached: in this chain the state happens to
# tell what was seen before. Find `memory=1` in the right half, and `memory=2` at the six. A chain
# in which one state is reached along different histories has a larger product (exercise 1).
#
# ## What happens in the long run
# In a finite chain, almost every path ends in a **bottom strongly connected component** (BSCC), a
# set of states that all reach each other and that no transition leaves. There it visits *each*
# state infinitely often (Baier & Katoen 2008, 10.1.2). So a BSCC as a whole is accepted or not, and
# the probability of the formula is that of reaching an accepted one. The rest is lesson 3.
#
# networkx calls BSCCs *attracting components*:

# %%
graph = both_events.to_networkx()
for component in networkx.attracting_components(graph):
    states = [both_events.states[number] for number in component]
    accepted = all(state["memory"] == SEEN_2 for state in states)
    print(states, "accepted" if accepted else "")

# %% [markdown]
# Each component is a single state, two of them are accepted, and the probability of reaching them
# is the one from above:

# %%
by_hand = both_events.check("P=? [ F s=7 & memory=1 ]")
print(by_hand, "|", both_events.check("P=? [ F G memory=1 ]"))
assert abs(float(by_hand) - float(mixed)) < 1e-12

# %% [markdown]
# ## Again and again, or for ever
# Here is a chain with a BSCC of two states: the machine works (1) and rests (2), or it breaks down
# at once (3).
#
# *Before you run the cell:* predict the four probabilities. Which states does a path visit
# infinitely often that goes to 1?

# %%
machine = symcheck.loads("""
dtmc
module machine
  x : [0..3] init 0;
  [] x=0 -> 0.7 : (x'=1) + 0.3 : (x'=3);
  [] x=1 -> 0.5 : (x'=1) + 0.5 : (x'=2);
  [] x=2 -> (x'=1);
  [] x=3 -> true;
endmodule
""")
expected = {"G F x=1": 0.7, "F G x=1": 0, "F G (x=1 | x=2)": 0.7, "F G x!=1": 0.3}
for formula, probability in expected.items():
    value = machine.check(f"P=? [ {formula} ]")
    print(f"{formula:16}", value)
    assert abs(float(value) - probability) < 1e-12

# %% [markdown]
# `G F x=1` needs *some* state with `x=1` in the BSCC, `F G x=1` needs that *all* are. The first
# acceptance condition is that of Büchi, the second its dual. Combined, "avoid these from some time
# on, and visit those again and again", is a Rabin pair. Deterministic automata need more than Büchi's condition: no
# deterministic Büchi automaton accepts exactly the words of `F G a` (Baier & Katoen 2008, 4.3.3).
# symcheck translates LTL into deterministic automata with generalised Rabin acceptance.
#
# ## Choices
# In a decision process a strategy resolves the choices, and it may try to stay somewhere for ever.
# What takes the place of a BSCC is an **end component**: a set of states, with some choices of
# each, that never leads out of the set and connects all of it (Baier & Katoen 2008, 10.6.3). Under
# every strategy, a path ends with probability 1 in an end component, and within one a strategy can
# visit all states again and again. So the *maximal* probability of an LTL formula is the maximal
# probability of reaching an accepting end component of the product. For the minimum one takes the
# maximum of the negation.
#
# Three philosophers sit at a table, with one fork between each two; a philosopher who draws lots
# takes the left or the right fork first. The scheduler decides who acts.
#
# *Before you run the cell:* can the scheduler prevent that *anybody* eats? Can it prevent that the
# *first* philosopher eats?

# %%
dining = symcheck.load("../models/dining/dining.nm")
somebody = dining.check('Pmin=? [ F "eating" ]')
starved = dining.check("Pmax=? [ G p1!=5 ]")
print("least probability that somebody eats:", somebody)
print("greatest probability that the first one never eats:", starved)
assert (somebody.value, starved.value) == (1, 1)

# %% [markdown]
# Both are 1. There is no end component without an eating philosopher: whatever the scheduler does,
# the random choices break the symmetry in the end. But there is one in which the first philosopher
# never eats: the scheduler can let the second or the third one eat, who never stops in this model.
# Both results come from graphs alone, so they are exact.
#
# ## Strategies with memory
# For reachability, a strategy needs to know only the current state (lesson 5). For LTL it decides
# in the *product*, so it may depend on the memory. The walker below has to visit both ends.

# %%
walk = symcheck.loads(
    "mdp module m x : [-2..2] init 0; [left] x>-2 -> (x'=x-1); [right] x<2 -> (x'=x+1); endmodule",
    strategy=True,
)
both_ends = walk.check("Pmax=? [ (F x=-2) & (F x=2) ]")
print(both_ends)
print(both_ends.strategy)

# %% [markdown]
# Read the table as instructions, from `x=0` with memory 0. The column `memory` is the automaton's
# memory *before* it reads `x`. At `x=0` the walker goes right with memory 0; at the right end it
# turns; back at `x=0` it has memory 1, which means that the right end was seen, and goes left.
# After the left end it has memory 3: both ends were seen, and it does not matter any more what it
# does.
#
# *Is memory needed?* Without memory, a deterministic strategy has one direction for each of -1, 0
# and 1; at the ends there is only one way to go. We try all eight:


# %%
def visits_both(directions):
    x, seen = 0, set()
    for _ in range(10):  # there are 5 states: nothing new comes after 5 steps
        seen.add(x)
        x += directions[x]
    return {-2, 2} <= seen


tried = [{-2: 1, -1: a, 0: b, 1: c, 2: -1} for a, b, c in combinations((-1, 1), repeat=3)]
print([visits_both(directions) for directions in tried])
assert not any(map(visits_both, tried))

# %% [markdown]
# None works: what is done at 0 is always the same, so one end is never seen. There is a way without
# memory, however, if the strategy may toss a coin:

# %%
tossing = symcheck.loads("""
dtmc
module m
  x : [-2..2] init 0;
  [] x>-2 & x<2 -> 0.5 : (x'=x-1) + 0.5 : (x'=x+1);
  [] x=-2 -> (x'=-1);
  [] x=2 -> (x'=1);
endmodule
""")
print(tossing.check("P=? [ (F x=-2) & (F x=2) ]"))

# %% [markdown]
# Chance replaces memory here, because both ends belong to one end component and time does not
# count. In general it does not (exercise 2).
#
# ## Summary
# - LTL describes whole paths; a deterministic automaton reads a path and remembers what matters.
# - The product of chain and automaton has the paths of the chain, with the same probabilities.
# - Acceptance depends on what is visited infinitely often, that is on the BSCC (in decision
#   processes: the end component) in which a path ends.
# - So the probability of an LTL formula is a reachability probability in the product.
# - Optimal strategies for LTL have the automaton as their memory.

# %% [markdown]
# ## Exercises

# %% [markdown]
# **Exercise 1.** Write the automaton of `F (s=1 & F s=3)` (first 1, later 3), build the product
# with `product`, and compare with `die.check`. Which states of the die occur with two memories, and
# why?

# %% [markdown] tags=["solution"]
# The memory counts how much of the pattern was seen. The die returns from `s=3` to `s=1`, so `s=1`
# and what follows it directly (`s=4` and its results) are reached with both memories. `s=3` itself
# completes the pattern, and always has memory 2.


# %% tags=["solution"]
def read_pattern(memory, state):
    if memory == 0 and state["s"] == 1:
        return 1
    if memory == 1 and state["s"] == 3:
        return 2
    return memory


pattern = product(read_pattern)
mine, theirs = pattern.check("P=? [ F memory=2 ]"), die.check("P=? [ F (s=1 & (F s=3)) ]")
assert abs(float(mine) - float(theirs)) < 1e-12
print(mine, "|", theirs, "|", len(pattern.states), "states")
memories = {}
for state in pattern.states:
    memories.setdefault((state["s"], state["d"]), set()).add(state["memory"])
twice = [pair for pair, found in memories.items() if len(found) == 2]
print("(s, d) with two memories:", twice)
assert twice == [(1, 0), (4, 0), (7, 2), (7, 3)]

# %% [markdown]
# **Exercise 2.** Which strategy maximises the probability of `(G F x=2) & (G F x=-2)` for the
# walker? Does it need memory? Does a strategy without memory that tosses coins do as well? Answer
# the same questions for `(F x=2) & (F G x<0)`.

# %% [markdown] tags=["solution"]
# Go to one end, then to the other, and so on: the strategy has to remember where it is going, and
# one bit is enough. Without memory and without chance, only one end at most is visited, as above.
# With a coin, the walk is a chain that is one single BSCC, so both ends are visited infinitely
# often with probability 1.

# %% tags=["solution"]
again = walk.check("Pmax=? [ (G F x=2) & (G F x=-2) ]")
print(again)
print(again.strategy)
print(tossing.check("P=? [ (G F x=2) & (G F x=-2) ]"))

# %% [markdown] tags=["solution"]
# `(F x=2) & (F G x<0)` has the maximum 1, too: first go to the right end, then walk between -2 and
# -1 for ever. Without memory, a coin does not help. To stay at negative `x` for ever, the strategy
# must always go left at -1. If it ever goes left at 0, it may do so at the very beginning, and then
# never sees the right end; if it never goes left at 0, it does not stay on the left side.

# %% tags=["solution"]
stay = walk.check("Pmax=? [ (F x=2) & (F G x<0) ]")
assert stay.value == 1
print(stay)
print(stay.strategy)

# %% [markdown]
# **Exercise 3.** Why does the automaton have to be deterministic? A fair coin is tossed once. The
# formula `(X a) | (X !a)` holds on every path. A nondeterministic automaton for it guesses at the
# first position which of the two will hold, and checks it at the second. Build its product with the
# coin as a decision process in which guesses are choices. What is the maximal probability of
# acceptance?

# %% [markdown] tags=["solution"]
# It is 1/2 and not 1. Each path has an accepting guess, but a strategy has to guess *before* the
# coin falls; the automaton may look into the future, the strategy may not. A deterministic
# automaton has one run on each path, so nothing has to be guessed.

# %% tags=["solution"]
guessing = symcheck.loads("""
mdp
module product
  guess : [0..2] init 0;  // 1: that a will hold, 2: that it will not
  coin : [0..2] init 0;   // 1: a holds, 2: it does not
  [a]     guess=0 -> 0.5 : (guess'=1) & (coin'=1) + 0.5 : (guess'=1) & (coin'=2);
  [not_a] guess=0 -> 0.5 : (guess'=2) & (coin'=1) + 0.5 : (guess'=2) & (coin'=2);
  []      guess>0 -> true;
endmodule
""")
right = guessing.check("Pmax=? [ F guess>0 & guess=coin ]")
assert right.value == 0.5
print(right)

# %% [markdown]
# **Exercise 4.** Two players watch a fair coin. One bets on heads-heads-tails, the other on
# heads-tails-tails; the pattern that comes first wins (W. Penney, *Penney-Ante*, Journal of
# Recreational Mathematics 2, 1969). Guess who is more likely to win. Then write a chain of the coin
# and an LTL formula for "HHT comes before HTT", and finally compute the same by hand, with an
# automaton that remembers the last two tosses.

# %% [markdown] tags=["solution"]
# HHT wins with probability 2/3. After the first head, another head (1/2) makes HHT certain.
# Otherwise a tail must follow for HTT (1/4); if it is a head, we are where we were after the first
# head. So $p = \frac12 + \frac14 p$.

# %% tags=["solution"]
coin = symcheck.loads("""
dtmc
module coin
  c : [0..2] init 0;
  [] true -> 0.5 : (c'=1) + 0.5 : (c'=2);
endmodule
label "H" = c=1;
label "T" = c=2;
""")
hht = '"H" & X ("H" & X "T")'
htt = '"H" & X ("T" & X "T")'
first = coin.check(f"P=? [ !({htt}) U ({hht}) ]")
print(first)


def toss(last):
    if last in ("HHT", "HTT"):
        return {last: 1}
    new = (last + "H", last + "T")
    return {seen if seen in ("HHT", "HTT") else seen[-2:]: 0.5 for seen in new}


game = symcheck.from_function("", toss, labels={"first": lambda last: last == "HHT"})
second = game.check('P=? [ F "first" ]')
print(second, "in", len(game.states), "states")
assert abs(float(first) - 2 / 3) < 1e-12
assert abs(float(second) - 2 / 3) < 1e-12
