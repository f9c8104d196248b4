# %% [markdown]
# # Lesson 2: Reachable states
# After this lesson you can compute reachable states set by set, read the two sizes of a set (states
# and nodes), and say what saturation does differently.
#
# Time: 30 minutes. You need lesson 1. A question in *italics* is for you: answer it before you run
# the next cell.
#
# ## Why reachable states?
# A state is a value for each variable, but most combinations of values never happen. The first step
# of a model checker finds those that can. Only they are states of the model; what is asked later
# ("how probable is an error?") is asked about them.

# %%
import symcheck
from symcheck import teach, view

die = symcheck.load("../models/die/die.pm")
view.state_graph(die)

# %% [markdown]
# This is the die of Knuth and Yao (D. E. Knuth, A. C. Yao: The complexity of nonuniform random
# number generation. Algorithms and Complexity, Academic Press 1976): a fair coin is tossed until a
# face is decided. A state shows `s`, the place in the tree of tosses, and `d`, the face. *How many
# tosses does the shortest path to a face take?*
#
# ## The search, with Python sets
# Begin with the initial states $R_0$, and add successors until nothing is new:
# $R_{i+1} = R_i \cup \mathrm{post}(R_i)$, where $\mathrm{post}(R)$ are the states that are one step
# after a state of $R$. What round $i$ found for the first time is its **frontier**. Only the
# frontier has to be looked at: the successors of older states are known already.

# %%
edges = [(source.number, target.number) for source, _, target, _ in die.transitions]
reached = frontier = set(die.states.initial.numbers.tolist())
rounds = 0
while frontier:
    print(f"round {rounds}: {len(frontier)} new, {len(reached)} in all")
    successors = {target for source, target in edges if source in frontier}
    frontier = successors - reached
    reached = reached | frontier
    rounds += 1
assert len(reached) == 13
assert rounds == 4

# %% [markdown]
# The loop ends when a round finds nothing new. Then $\mathrm{post}(R) \subseteq R$: the set is a
# **fixpoint**, and the least one that contains the initial states. A round is a step of the model,
# so the faces, found in round 3, need three tosses at least.
#
# ## The search, with diagrams
# The loop costs time for each state and each edge. With diagrams, the same loop costs operations on
# *nodes*. A set of states is a BDD over the bits of the variables, as in lesson 1. The transitions
# are a BDD over twice as many bits: those of the state before the step, and those after it. The
# successors of $R$ are one formula,
#
# $$\mathrm{post}(R)(x') = \exists x.\; R(x) \wedge T(x, x'),$$
#
# an `apply` and the quantification of exercise 2 of lesson 1; then $x'$ is renamed to $x$. (J. R.
# Burch, E. M. Clarke, K. L. McMillan, D. L. Dill, L. J. Hwang: Symbolic model checking: 10^20
# states and beyond. Information and Computation 98(2), 1992.)
#
# `teach.frontiers` shows each iteration of this search. The numbers of states are those of your
# loop.

# %%
trace = teach.frontiers(die)
for frame in trace:
    print(frame)
assert [frame.iteration.states for frame in trace] == [1, 3, 7, 13, 13]

# %% [markdown]
# In a notebook, a trace is a player. Step through it with the arrow: the state graph on the left
# shows what is reached, and the diagram on the right the set, value by value. *Between which
# iterations does the diagram change most?*

# %%
trace

# %% [markdown]
# In iterations 0 to 2 every state has `d=0`, so only the part for `s` changes. The faces come all
# at once, in iteration 3, and the diagram gets a second branch for `d`.
#
# ## States and nodes
# Now a model with more states: three philosophers who toss coins to decide which fork to take first
# (D. Lehmann, M. O. Rabin: On the advantages of free choice. POPL 1981).

# %%
dining = symcheck.load("../models/dining/dining.nm")
search = [frame.iteration for frame in teach.frontiers(dining)]
for iteration in search:
    print(f"{iteration.number}: {iteration.states:3} states, {iteration.nodes:2} nodes")
assert search[-1].states == 155

# %%
view.plot_search(search, title="dining");

# %% [markdown]
# The number of states can only grow. The number of nodes rises and falls: the largest diagram
# belongs to a set *on the way*, not to the result. **A set can grow and become simpler.** A
# half-explored set has a ragged border, which the diagram must describe; when the search is
# finished, what is left are the rules of the model, such as "two neighbours never hold the same
# fork".
#
# So a search needs memory for the largest diagram on the way, the **peak**. Two queues in a row
# (`models/tandem/tandem.sm`) show how bad this can be. They have room for `c` customers each.

# %%
tandem = symcheck.load("../models/tandem/tandem.sm", constants={"c": 31})
search = [frame.iteration for frame in teach.frontiers(tandem)]
print(len(search), "iterations,", search[-1].states, "states")
print("peak:", max(i.nodes for i in search), "nodes; result:", search[-1].nodes, "nodes")
assert search[-1].nodes < 10 < 80 < max(i.nodes for i in search)
view.plot_search(search, title="tandem, c=31").get_legend().set_loc("lower center");

# %% [markdown]
# At the end almost every combination of values is possible (the first queue has two phases of
# service, and is in the first one when it is empty), which is a tiny diagram: 2016 states in 7
# nodes. On the way, the search knows the states with at most $i$ steps, and that is a complicated
# set.
#
# *How do states and nodes of the result grow if `c` grows from 3 to 63?*

# %%
print("  c   states  nodes")
for c in (3, 7, 15, 31, 63):
    bound = tandem.with_constants({"c": c}).bound
    space = symcheck.reach(symcheck.build(bound, symcheck.Options()))
    print(f"{c:3}{space.count:9}{space.states.node_count:7}")
    assert space.count == (c + 1) * (2 * c + 1)
    assert space.states.node_count < 12

# %% [markdown]
# States grow fourfold in each line, nodes by about one. This is what "symbolic" buys, for models
# that have regular sets of states. (For a set without any regularity, a diagram is hardly better
# than a list.)
#
# ## Saturation
# The search above takes all commands in each round. A *schedule* says in which order the commands
# are applied, and the order is free: the fixpoint is the same, hence the same diagram.
# **Saturation** works from the bottom of the diagram up. A node is closed under all commands that
# only touch variables at its level and below, before any node above it is looked at. The sets on
# the way are then finished in their lower part, without a ragged border (G. Ciardo, G. Lüttgen, R.
# Siminiceanu: Saturation: an efficient iteration strategy for symbolic state-space generation.
# TACAS 2001, LNCS 2031).

# %%
bound = tandem.bound
spaces = {}
for schedule in ("frontier", "chaining", "saturation"):
    spaces[schedule] = symcheck.reach(symcheck.build(bound, symcheck.Options()), schedule=schedule)
    space = spaces[schedule]
    print(f"{schedule:12}{space.count} states, {space.states.node_count} nodes")
assert len({(s.count, s.states.node_count) for s in spaces.values()}) == 1

# %% [markdown]
# Three ways, one result. (*Chaining* applies the commands one after the other and uses each result
# at once.) *What does saturation gain here?* `teach.frontiers` takes a schedule, too:

# %%
for schedule in ("frontier", "chaining", "saturation"):
    frames = list(teach.frontiers(tandem, schedule))
    peak = max(frame.iteration.nodes for frame in frames)
    print(f"{schedule:12}{len(frames):3} frames, at most {peak:2} nodes in one of them")

# %% [markdown]
# Saturation has no rounds: it is one recursion through the diagram, which the trace shows as a
# single frame after the initial one. (So the table does not count its nodes on the way; the article
# measures them.) Without CUDD, symcheck keeps the order of the commands, but applies them to whole
# sets. Saturation is the default.
#
# ## By hand
# You need not believe the tool. An encoded model has `successors`, and sets have `|`, `&` and `~`:

# %%
symbolic = symcheck.build(bound, symcheck.Options())
reached, rounds = symbolic.initial, 0
while (new := symbolic.successors(reached) & ~reached) != symbolic.manager.false:
    reached, rounds = reached | new, rounds + 1
print(rounds, "rounds,", reached.node_count, "nodes")
assert reached.node_count == spaces["saturation"].states.node_count

# %% [markdown]
# The test `!=` compares two nodes, whatever the sets are: that is canonicity at work.
# (`teach.frontiers` has two more frames: the one of the initial states, and the last one, which
# finds nothing.)
#
# ## Summary
# - The reachable states are the least fixpoint of "add the successors".
# - With diagrams, a round costs operations on nodes. Nodes rise and fall while states grow.
# - The peak is what memory must hold; saturation keeps it low, and the result is the same.
#
# ## Exercises

# %% [markdown]
# **Exercise 1.** Which states of `dining` are farthest from the initial state, and in which round
# are they found? What do the philosophers do there?

# %% tags=["solution"]
last = list(teach.frontiers(dining, limit=20))[-2]
print(last)
assert last.iteration.number == 6
assert last.iteration.frontier == 14

# %% [markdown] tags=["solution"]
# The last frame finds nothing; the one before it is round 6, with 14 new states. In each of them
# everybody has a fork or waits for one: `(4,4,4)`, for example, where all three hold their right
# fork only, needs two steps of each philosopher.

# %% [markdown]
# **Exercise 2.** A *deadlock* is a state without successors. Does `dining` have one? Compute it
# twice: with `model.deadlocks`, and with `predecessors` of a symbolic model (a state with a
# successor is a predecessor of some state). What would a deadlock mean for the philosophers?

# %% tags=["solution"]
assert len(dining.deadlocks) == 0
symbolic = symcheck.build(dining.bound, symcheck.Options())
space = symcheck.reach(symbolic)
stuck = space.states & ~symbolic.predecessors(space.states)
assert stuck == symbolic.manager.false

# %% [markdown] tags=["solution"]
# There is none: one philosopher can always act. In a deadlock nobody could do anything, so
# everybody would starve. That is what happens without coins, when all hold their right fork and
# insist on it.

# %% [markdown]
# **Exercise 3.** From which states can the die still show a six? Search backward: begin with `d=6`,
# and add predecessors, by the list `edges`. Lesson 3 needs this set.

# %% tags=["solution"]
can = set(die.where("d=6").numbers.tolist())
while more := {s for s, t in edges if t in can} - can:
    can |= more
print([str(die.states[number]) for number in sorted(can)])
assert sorted(can) == die.where("P>0 [ F d=6 ]").numbers.tolist()

# %% [markdown] tags=["solution"]
# From the start, from the right half of the tree as long as it can lead to a six, and from the six
# itself: four states of 13.
