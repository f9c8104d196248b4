# %% [markdown]
# # Lesson 1: Decision diagrams from scratch
# After this lesson you can build a binary decision diagram (BDD) by Shannon expansion, say why it
# is canonical, predict what an order of the variables costs, and find the same structure in a model
# of symcheck.
#
# Time: 40 minutes. You need Python; no model checking yet. A question in *italics* is for you:
# answer it before you run the next cell.
#
# ## The problem
# A model checker works with sets of states, and a set may have $10^{20}$ of them. It cannot be
# stored as a list. But a state is a row of bits, so a set of states is a *function* of bits: 1 for
# the states in the set, 0 for the others. A decision diagram is a way to store such a function. It
# is often small although the set is large, and this lesson builds one, in about forty lines of
# Python.
#
# ## Shannon expansion
# Ask for the value of one variable. Then only a smaller function is left, one for each answer (C.
# E. Shannon: A symbolic analysis of relay and switching circuits. Transactions of the AIEE 57,
# 1938):
#
# $$f = (\neg x \wedge f_{x=0}) \vee (x \wedge f_{x=1})$$
#
# $f_{x=0}$ and $f_{x=1}$ are the *cofactors* of $f$. If you go on with the next variable, you get a
# tree with a leaf for each row of the truth table: $2^n$ leaves, which gains nothing. Two rules
# make a small graph of it:
#
# 1. **No useless test**: if both answers lead to the same node, the node is left out.
# 2. **No duplicates**: a variable with the same two successors is the same node. A table finds it,
#    the *unique table*.
#
# Nodes are numbers below: 0 and 1 are the leaves, and `nodes[n]` is a triple: the level of the
# variable in the order, the successor for 0 (`low`), and the one for 1 (`high`).

# %%
class Diagrams:
    """Reduced ordered BDDs over the variables `order`."""

    def __init__(self, order):
        self.order = order
        self.nodes = [(len(order), None, None)] * 2  # the leaves stand below all variables
        self.unique = {}

    def node(self, level, low, high):
        if low == high:  # rule 1
            return low
        key = (level, low, high)
        if key not in self.unique:  # rule 2
            self.unique[key] = len(self.nodes)
            self.nodes.append(key)
        return self.unique[key]


# %% [markdown]
# Everything depends on these ten lines: nodes are made by `node` only, so the two rules hold
# always. *What do these three calls return?*

# %%
bdds = Diagrams(["x", "y", "z"])
first = bdds.node(2, 0, 1)  # is z true?
again = bdds.node(2, 0, 1)
useless = bdds.node(1, first, first)  # asks for y, and does the same in both cases
print(first, again, useless)
assert first == again == useless == 2

# %% [markdown]
# One node was made, number 2. The second call found it in the table, and the third would have been
# a useless test.
#
# Now the expansion itself. `of` takes a Python function of bits, and calls itself for the two
# values of the next variable. When all of them have values, the function is called, and gives a
# leaf.

# %%
def of(self, function, bits=()):
    """The diagram of a function of bits."""
    if len(bits) == len(self.order):
        return int(bool(function(*bits)))
    low, high = of(self, function, (*bits, False)), of(self, function, (*bits, True))
    return self.node(len(bits), low, high)


# %% [markdown]
# Two helpers print what was made. `below` collects the nodes that can be reached from one, and
# `show` prints a line for each, lowest number first. The last line makes methods of the three.

# %%
def show(self, f):
    """Print the nodes below f, a line for each."""
    for n in sorted(below(self, f)):
        if n > 1:
            level, low, high = self.nodes[n]
            print(f"node {n}: if {self.order[level]} then {high} else {low}")


def below(self, f):
    """The set of the nodes below f, leaves included."""
    return {f} if f < 2 else {f} | below(self, self.nodes[f][1]) | below(self, self.nodes[f][2])


Diagrams.of, Diagrams.show, Diagrams.below = of, show, below

# %% [markdown]
# The majority of three bits is 1 if at least two of them are. The tree of all its tests has 15
# nodes, 8 of them leaves. *How many are left by the two rules?*

# %%
majority = bdds.of(lambda x, y, z: x + y + z >= 2)
bdds.show(majority)
print(len(bdds.below(majority)), "nodes with the leaves")
assert len(bdds.below(majority)) == 6

# %% [markdown]
# Follow a path: if $x$ and $y$ are both 0, the answer is 0, and nobody asks for $z$ (rule 1). If
# exactly one of them is 1, $z$ decides, and both cases share *one* node for $z$ (rule 2), the one
# that you made by hand above. Draw the diagram on paper: one node for $x$, two for $y$, one for
# $z$, and the two leaves.
#
# ## Canonicity
# For one order of the variables, **equal functions have the same node** (R. E. Bryant: Graph-based
# algorithms for Boolean function manipulation. IEEE Transactions on Computers C-35(8), 1986,
# theorem 1). Why? Suppose that it is true for functions of $n-1$ variables. Two equal functions of
# $n$ variables have equal cofactors, whose nodes are then the same, and the two rules make the same
# node of them. So the comparison of two functions is the comparison of two numbers. Here is the
# majority again, written differently:

# %%
other = bdds.of(lambda x, y, z: (x and y) or (z and (x or y)))
assert other == majority
print("nodes", majority, "and", other)

# %% [markdown]
# This is what makes a fixpoint cheap to detect: lesson 2 repeats a step until the set stays the
# same, and "the same" is one comparison.
#
# ## Operations without truth tables
# `of` calls its function $2^n$ times, so it is for small examples only. Real packages combine
# diagrams. To compute $f \vee g$, expand *both* by the variable that comes first in the order:
#
# $$(f \vee g)_{x=0} = f_{x=0} \vee g_{x=0}, \qquad (f \vee g)_{x=1} = f_{x=1} \vee g_{x=1}$$
#
# A cache remembers the pairs of nodes that are done. So there are at most $|f| \cdot |g|$ calls,
# however many states the sets have: **operations cost nodes, not states**. A diagram that does not
# ask for the variable is its own cofactor.

# %%
from functools import cache


def cofactors(self, n, level):
    """What n is if the variable of this level is 0, and if it is 1."""
    return self.nodes[n][1:] if self.nodes[n][0] == level else (n, n)


def apply(self, operator, f, g):
    """The diagram of `f operator g`."""

    @cache
    def walk(f, g):
        if f < 2 and g < 2:
            return int(operator(f, g))
        level = min(self.nodes[f][0], self.nodes[g][0])
        f0, f1 = cofactors(self, f, level)
        g0, g1 = cofactors(self, g, level)
        return self.node(level, walk(f0, g0), walk(f1, g1))

    return walk(f, g)


Diagrams.apply = apply

# %% [markdown]
# We build the majority in two parts: both $x$ and $y$, or $z$ and one of them. *What will the
# number of the node be?*

# %%
both = bdds.of(lambda x, y, z: x and y)
decided_by_z = bdds.of(lambda x, y, z: z and (x or y))
built = bdds.apply(lambda a, b: a | b, both, decided_by_z)
assert built == majority

# %% [markdown]
# A third way to the majority, and the same node again.
#
# ## The order decides the size
# Two words of $n$ bits are equal: $(x_1 = y_1) \wedge \dots \wedge (x_n = y_n)$. This function is
# in every model, since it says that a variable keeps its value in a step. We try two orders: each
# $x_i$ next to its $y_i$, and all $x$ before all $y$. *What must a diagram remember after it has
# read all the $x$?*

# %%
def size_of_equality(n, together):
    xs, ys = [f"x{i}" for i in range(n)], [f"y{i}" for i in range(n)]
    order = [name for pair in zip(xs, ys) for name in pair] if together else xs + ys

    def equal(*bits):
        value = dict(zip(order, bits))
        return all(value[x] == value[y] for x, y in zip(xs, ys))

    diagrams = Diagrams(order)
    return len(diagrams.below(diagrams.of(equal)))


print("bits  together  apart")
for n in range(1, 7):
    close, apart = size_of_equality(n, True), size_of_equality(n, False)
    print(f"{n:4}{close:10}{apart:7}")
    assert close == 3 * n + 2
    assert apart == 3 * 2**n - 1

# %% [markdown]
# Together, the diagram has to remember one bit at a time: three nodes per pair, $3n+2$ in all.
# Apart, it must remember the whole word $x$, which has $2^n$ values: $3 \cdot 2^n - 1$ nodes. For
# 32 bits that is 98 nodes against 13 billion. So symcheck puts the bit of a variable before a step,
# and its bit after the step, next to each other.
#
# To find the best order is NP-hard (B. Bollig, I. Wegener: Improving the variable ordering of OBDDs
# is NP-complete. IEEE Transactions on Computers 45(9), 1996); tools use heuristics.
#
# ## Leaves with numbers
# If a leaf may be any number, the diagram is a *multi-terminal* BDD, an MTBDD. It stores a vector
# (a number for each state) or a matrix: a function of the bits of the row and of those of the
# column. Only the leaves change; the two rules stay.
#
# A leaf with the number 0.25 becomes a node with the level "leaf", whose `low` is the number. So
# the unique table keeps equal numbers together, too.

# %%
class NumberDiagrams(Diagrams):
    def of(self, function, bits=()):
        if len(bits) == len(self.order):
            return self.node("leaf", float(function(*bits)), None)
        low, high = self.of(function, (*bits, False)), self.of(function, (*bits, True))
        return self.node(len(bits), low, high)


matrix = NumberDiagrams(["row", "column"])
root = matrix.of(lambda row, column: 0.25 if row == column else 0.5)
for number, triple in list(enumerate(matrix.nodes))[2:]:
    print(number, triple)

# %% [markdown]
# This is the matrix with 0.25 on the diagonal and 0.5 beside it: two leaves for the two numbers
# (not four for the four entries), two nodes that ask for the column, and one for the row.
#
# ## The same in symcheck
# symcheck holds the reachable states of a model in a BDD, and its transition matrix in an MTBDD.
# This die of Knuth and Yao tosses a coin until it knows a face: `s` is the place in a tree of
# tosses, and `d` the face, 0 while it is open. *Both variables need three bits. How many of the 64
# combinations will be reachable?*

# %%
import symcheck
from symcheck import teach, view

die = symcheck.load("../models/die/die.pm", engine="mtbdd")
space = symcheck.reach(symcheck.build(die.bound, symcheck.Options()))
print(space.count, "states in", space.states.node_count, "nodes")
assert space.count == 13
view.picture(space.states, space.symbolic.encoding)

# %% [markdown]
# The picture groups the bits of a variable: an edge has the values for which it is taken, and edges
# to 0 are left out. Read it: while `s` is 0 to 6 the face is 0, and when `s` is 7 the face is 1 to
# 6. That is $7 + 6 = 13$ states.
#
# Drawn bit by bit, it is a diagram like those that you have built. A node asks for one bit: `+4` is
# the bit of its variable that counts 4. A dashed edge is the answer 0. (The buttons above the
# picture enlarge it, and fit it into its frame.) *Count the nodes. Why does symcheck say 9?*

# %%
view.picture(space.states, space.symbolic.encoding, bits=True)

# %% [markdown]
# The picture has 11 nodes. BDD packages mark an edge as *negated*, so that a function and its
# negation are one node (K. S. Brace, R. L. Rudell, R. E. Bryant: Efficient implementation of a BDD
# package. DAC 1990). Two of the nodes for bits of `d` are such negations, and are not counted.
#
# `teach.compare_orders` builds a model under several orders. These are three dining philosophers,
# who sit in a circle; the bars are the nodes of the reachable states and of the matrix. *Do you
# expect a large difference for three variables?*

# %%
dining = symcheck.load("../models/dining/dining.nm")
frames = list(teach.compare_orders(dining))
assert len({frame.states_nodes for frame in frames}) == 2
view.plot_orders(frames, title="dining: nodes by order");

# %% [markdown]
# (Without CUDD, symcheck draws the states only.) The matrix is much larger than the set of states:
# it relates a state to another one, so it has twice as many bits. There are only two sizes among
# the six orders. The three that are rotations of `p1 < p2 < p3` have the same one, because the
# circle looks the same from every seat; the other three go round the circle the other way. Where
# variables have no such symmetry, orders differ by far more, as equality has shown.
#
# ## Summary
# - A BDD is a tree of tests with two rules: no useless test, no duplicates.
# - It is canonical for an order: equal functions are the same node.
# - Operations cost products of numbers of nodes, and the order decides how many there are.
# - With numbers at the leaves it is an MTBDD, for vectors and matrices.
#
# ## Exercises

# %% [markdown]
# **Exercise 1.** Which order is best for `x1 & y1 | x2 & y2 | x3 & y3`, and how many nodes does it
# need? Predict, then measure that order and the order `x1 x2 x3 y1 y2 y3`.

# %% [markdown] tags=["solution"]
# Pairs together: two nodes per pair, and the two leaves, 8 in all. If all $x$ come first, the
# diagram has to remember which of them are true: 16 nodes. (The example is Bryant's, in the article
# of 1986.)

# %% tags=["solution"]
pairs = Diagrams(["x1", "y1", "x2", "y2", "x3", "y3"])
good = pairs.of(lambda x1, y1, x2, y2, x3, y3: x1 & y1 | x2 & y2 | x3 & y3)
apart = Diagrams(["x1", "x2", "x3", "y1", "y2", "y3"])
bad = apart.of(lambda x1, x2, x3, y1, y2, y3: x1 & y1 | x2 & y2 | x3 & y3)
assert (len(pairs.below(good)), len(apart.below(bad))) == (8, 16)

# %% [markdown]
# **Exercise 2.** Write a function `restrict(self, f, name, value)` that gives a cofactor, and
# quantify $x$ out of `majority`: $\exists x.\,f = f_{x=0} \vee f_{x=1}$. What is the result, and
# why? (Lesson 2 needs this operation for the successors of a set.)

# %% tags=["solution"]
def restrict(self, f, name, value):
    level = self.order.index(name)

    def walk(n):
        here, low, high = self.nodes[n]
        if here > level:  # below the variable: nothing to replace
            return n
        if here == level:
            return high if value else low
        return self.node(here, walk(low), walk(high))

    return walk(f)


low, high = (restrict(bdds, majority, "x", bit) for bit in (False, True))
exists = bdds.apply(lambda a, b: a | b, low, high)
assert exists == bdds.of(lambda x, y, z: y or z)

# %% [markdown] tags=["solution"]
# If you may choose $x$, choose 1: then one of $y$ and $z$ is enough for a majority, so the result
# is $y \vee z$.

# %% [markdown]
# **Exercise 3.** The parity of $n$ bits is 1 if an odd number of them is 1. How many nodes has its
# diagram, and why does the order not matter?

# %% [markdown] tags=["solution"]
# Two nodes per variable (an even number so far, or an odd one), but one for the first: $2n-1$, and
# two leaves. Parity is symmetric: it stays the same if variables change places, so every order
# gives the same diagram. A truth table has $2^n$ rows.

# %% tags=["solution"]
for n in (3, 5, 7):
    d = Diagrams([f"b{i}" for i in range(n)])
    assert len(d.below(d.of(lambda *bits: sum(bits) % 2))) == 2 * n - 1 + 2
