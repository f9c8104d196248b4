# %% [markdown]
# # Lesson 8: The blocks of the hybrid engine
# After this lesson you can say how a matrix is stored as a diagram, why equal blocks are stored
# once, and when the hybrid engine is the right choice.
#
# Time: 30 minutes. You need lessons 1 and 3.
#
# It needs CUDD: the matrices are diagrams with numbers (MTBDDs), which `dd.autoref` does not have.
# [Without CUDD](../docs/getting_started.md#without-cudd), `teach.construction` shows guards,
# updates and relations, and the other cells say what is missing.
#
# The source is D. Parker, *Implementation of symbolic model checking for probabilistic systems*,
# PhD thesis, University of Birmingham 2002: chapter 3 for matrices as MTBDDs, chapter 6 for the
# hybrid engine. MTBDDs are due to M. Fujita, P. McGeer and J. Yang, and to R. I. Bahar et al., both
# in Formal Methods in System Design 10, 1997.

# %%
import numpy as np
import symcheck
from symcheck import teach, view

# %% [markdown]
# ## A matrix that repeats itself
# A matrix with $2^k$ rows and columns can be cut into four quarters. The first bit of a row number
# tells whether the row is in the upper or in the lower half, the first bit of a column number tells
# left or right. The next bits cut each quarter again, until single numbers are left. So a matrix is
# a function of bits, and lesson 1 applies: a quarter that occurs twice is stored once.
#
# How often does that happen? Take components that work independently: each fails with rate 3 and is
# repaired with rate 5. With $k$ components there are $2^k$ states, one bit per component.
# `components(k)` puts two copies of the smaller matrix on the diagonal, where the first component
# does not change, and its failures and repairs into the other two quarters.


# %%
def components(k):
    """The rates of k independent components, float64[2**k, 2**k]."""
    if k == 0:
        return np.zeros((1, 1))
    others, same = components(k - 1), np.eye(2 ** (k - 1))
    return np.block([[others, 3 * same], [5 * same, others]])


components(3).astype(int)

# %% [markdown]
# Look at the quarters: upper left and lower right are equal, the other two are 3 times and 5 times
# an identity matrix. *Before you go on:* how many different blocks of size 4, 2 and 1 does this
# matrix have, if blocks of zeros are not counted?
#
# ## Store each block once
# The next cell is the whole idea. A block is a number, or the tuple of its four quarters. A *unique
# table* gives each distinct block one number, as `node` in lesson 1 did with cofactors. Zero blocks
# are `None` and take no entry.


# %%
def store(matrix, table):
    """The number of a block in `table`, which has each distinct block once; None: zeros."""
    if not matrix.any():
        return None
    half = len(matrix) // 2
    if half == 0:
        key = matrix[0, 0]
    else:
        upper, lower = matrix[:half], matrix[half:]
        quarters = upper[:, :half], upper[:, half:], lower[:, :half], lower[:, half:]
        key = tuple(store(quarter, table) for quarter in quarters)
    return table.setdefault(key, len(table))


for k in range(1, 9):
    table, matrix = {}, components(k)
    store(matrix, table)
    transitions = np.count_nonzero(matrix)
    print(f"k={k}: {2**k:3} states, {transitions:4} transitions, {len(table):2} blocks")
    assert len(table) == 3 * k
    assert transitions == k * 2**k

# %% [markdown]
# For $k=3$ there is the matrix itself, three blocks of size 4 (the matrix of two components, 3
# times and 5 times the identity), three of size 2 in the same way, and the numbers 3 and 5: nine
# together. In general each component doubles the states, and adds *three* blocks. So $k\,2^k$
# transitions take $3k$ blocks. This is the reason for symbolic engines.
#
# symcheck builds such a diagram from the text of the model, without ever writing the matrix. Twelve
# components are twelve modules:

# %%
text = "ctmc module c1 x1 : [0..1]; [] x1=0 -> 3:(x1'=1); [] x1=1 -> 5:(x1'=0); endmodule\n"
text += "\n".join(f"module c{i} = c1 [ x1=x{i} ] endmodule" for i in range(2, 13))
twelve = symcheck.loads(text, engine="hybrid")
shape = teach.block_structure(twelve)
print(len(twelve.states), "states,", len(twelve.transitions), "transitions,", shape.nodes, "nodes")
assert (len(twelve.states), len(twelve.transitions), shape.nodes) == (2**12, 12 * 2**12, 36)

# %% [markdown]
# It has $3 \cdot 12$ nodes, as many as your blocks. A node of this structure divides a block into
# four at once; the diagrams below test a single bit per node, so they have more.
#
# ## From commands to the matrix
# How does one build a matrix without writing it? A guard is a set of states, an update a relation
# between states before and after. A command is the sum of its updates, weighted with their
# probabilities and restricted to its guard. Commands that synchronise are multiplied, and the
# matrix is the sum of what remains. All of these are diagrams, and each step is one operation on
# diagrams. The result is an MTBDD, a BDD with numbers as leaves. Row bits and column bits alternate
# in the order, so each pair of levels chooses a quarter.
#
# Play the trace for the die. Watch three things: the states in which a command is enabled (blue),
# the number of nodes in the title, and the last frame with the complete matrix.

# %%
die = symcheck.load("../models/die/die.pm")
frames = teach.construction(die)
frames

# %%
last = list(frames)[-1]
print(len(die.transitions), "transitions,", last.nodes, "nodes")
assert (len(die.transitions), last.nodes) == (20, 71)

# %% [markdown]
# More nodes than transitions, even if the three tests that divide a block into four (one row bit,
# then a column bit in each half) are counted as one. The die is small and irregular: hardly any
# block occurs twice. Diagrams do not compress everything; they use *regularity*.
#
# ## Numbers for the states
# The die has 6 bits, but 13 of the 64 valuations are reachable. Vectors should have 13 entries and
# not 64, so one needs the number of a state among the reachable ones. Parker's solution is the
# **ODD**, an offset-labelled BDD. At each node of the BDD of reachable states stands how many
# states lie on its 0 branch. The number of a state is the sum of the offsets at those nodes where
# its path takes the 1 branch, because all states of the 0 branch come before it.

# %%
levels = teach.block_structure(die).levels
for level in levels:
    print(level.bit, "offsets:", level.offsets, " states below:", level.counts)

# %% [markdown]
# Follow the state `s=7, d=6`, with the bits 111 and 110. The root has offset 4: four states have
# `s.2=0`. The path takes the 1 branch, so add 4. Of the other nine, two have `s.1=0`, and one of
# the remaining seven has `s.0=0`. The six results are left. Three of them have `d.2=0`, and two of
# the last three have `d.1=0`. The last bit is 0 and adds nothing:

# %%
number = 4 + 2 + 1 + 3 + 2 + 0
assert number == die.states[{"s": 7, "d": 6}].number == 12
print(number)

# %% [markdown]
# ## Blocks of a real matrix
# Now matrix and numbers are put together. To compute $y = Ax$, walk down the matrix diagram and
# the ODD at once; the offsets tell where in $x$ and $y$ a quarter begins. Walking down to single
# numbers is slow, so the **hybrid engine** stops where blocks are small. It writes each *distinct*
# block out once, and lists where it occurs.
#
# A polling server goes around four stations and serves waiting jobs. `budget` limits how much may
# be written out for all distinct blocks together; 1 forces a division that one can see. *Before you
# run the cell:* the first variable in the order is the position of the server. What do you expect
# to see four times?

# %%
polling = symcheck.load("../models/polling/polling.sm", engine="hybrid")
blocks = teach.block_structure(polling, budget=1)
view.plot_blocks(blocks, title="polling: the matrix by blocks")
print(f"{len(blocks.blocks)} distinct blocks, {len(blocks.occurrences)} occurrences, ", end="")
print(f"{len(polling.transitions)} transitions")
assert (len(blocks.blocks), len(blocks.occurrences)) == (10, 16)

# %% [markdown]
# Equal colours are the same block. The two blue ones occur four times, once for each position of
# the server: the arrivals of jobs while it is idle, and while it is busy, which do not depend on
# the position. The other colours are the server's moves. They look alike but differ, because the
# server asks for another job at each station. The red block in the lower left leads from station 4
# back to station 1. White is zero and takes no memory. Blocks need not begin at multiples of a
# power of 2, since unreachable states are left out.
#
# This is a product by blocks. An occurrence has a block, and its first row and column (the number
# before them is for decision processes). `content` is what the block has written out, here cut from
# the matrix. Each occurrence adds its share to `y`:

# %%
A = polling.matrix.toarray()
x = np.random.default_rng(1).random(len(A))
y, content = np.zeros(len(A)), {}
for _, block, row, column in blocks.occurrences:
    height, width, _ = blocks.blocks[block]
    to, start = slice(row, row + height), slice(column, column + width)
    content.setdefault(block, A[to, start])
    assert np.array_equal(content[block], A[to, start])
    y[to] += content[block] @ x[start]
assert np.allclose(y, A @ x)
print(len(content), "blocks were read; the product agrees")

# %% [markdown]
# Only the *first* occurrence of each block was kept. The first assertion says that the others are
# equal, the second that nothing is missing.
#
# ## What it saves
# The same product can be stored in three ways:
#
# | engine | matrix | vector |
# |---|---|---|
# | sparse | rows with their entries | array |
# | hybrid | the distinct blocks of the diagram, once each | array |
# | mtbdd | diagram | diagram |
#
# Kanban is a manufacturing line of four machines with $t$ tickets each (G. Ciardo and M. Tilgner,
# ICASE Report 96-35, 1996). *Before you run the cell:* from row to row, do nodes grow as fast as
# transitions?

# %%
for t in (1, 2, 3, 4):
    kanban = symcheck.load("../models/kanban/kanban.sm", constants={"t": t}, engine="hybrid")
    shape = teach.block_structure(kanban)
    rows = 12 * len(kanban.transitions)  # a double and the number of its column, for each entry
    print(
        f"t={t}: {len(kanban.states):7,} states, {len(kanban.transitions):9,} transitions; ", end=""
    )
    print(f"{shape.nodes:3} nodes; rows {rows / 1e3:6,.0f} kB, blocks {shape.nbytes / 1e3:3.0f} kB")
assert shape.nodes < 500
assert rows > 400 * shape.nbytes

# %% [markdown]
# Each ticket multiplies the transitions by nearly nine or more, and adds only 100 to 140 nodes.
# With four tickets, the blocks take less than a four-hundredth of the rows. For small `t` they save
# less, because the engine writes out large blocks while these take little memory.
#
# The *vector*, however, is still an array with a number per state. When the matrix has become
# small, the vectors are what fills the memory: 8 bytes per state and vector. The mtbdd engine
# stores them as diagrams too. That pays only if few distinct values occur, since a diagram has a
# leaf for each of them.
#
# ## The same answers
# An engine is a way to store, not a way to answer:

# %%
answers = []
for engine in ("explicit", "sparse", "hybrid", "mtbdd"):
    model = symcheck.load("../models/kanban/kanban.sm", constants={"t": 1}, engine=engine)
    answers.append(model.check("S=? [ work1=0 ]"))
    print(f"{engine:9}", answers[-1])
assert np.allclose([float(answer) for answer in answers], float(answers[0]), rtol=1e-6)

# %% [markdown]
# So when is the hybrid engine the right choice? If the rows fit into memory, they are the simple
# choice: sparse. If a model has many more transitions than fit, but is built of components that
# repeat (machines, stations, processes), the blocks still fit: hybrid. If the diagram of the states
# has as many nodes as there are states, diagrams are the wrong container: explicit. By default
# symcheck tries and chooses; [Engines](../docs/engines.md) says how.
#
# ## Summary
# - A matrix is a function of row and column bits; as a diagram it stores each distinct quarter
#   once.
# - It is built from commands by operations on diagrams, never entry by entry.
# - An ODD numbers the reachable states: the sum of offsets along a path.
# - The hybrid engine writes out distinct blocks once, lists their occurrences, and multiplies them
#   with arrays.
# - Regular models gain orders of magnitude; irregular ones lose.

# %% [markdown]
# ## Exercises

# %% [markdown]
# **Exercise 1.** Which number does the ODD give to `s=7, d=3`? Add the offsets by hand. (At
# each level, the number of states below tells which node is meant. Of the two nodes of `d.1` with
# three states below, the one with offset 1 belongs to the results 1, 2 and 3.) Check with
# `die.states`.

# %% [markdown] tags=["solution"]
# The bits are 111 and 011. As above, `s=7` adds 4, 2 and 1. `d.2` is 0 and adds nothing; of the
# results 1, 2 and 3, one has `d.1=0`; of 2 and 3, one has `d.0=0`.

# %% tags=["solution"]
assert die.states[{"s": 7, "d": 3}].number == 4 + 2 + 1 + 0 + 1 + 1

# %% [markdown]
# **Exercise 2.** Multiply a vector by a block matrix by hand: for
# $P = \begin{pmatrix} B & 0 \\ C & B \end{pmatrix}$ compute $Px$ with numpy from `B` and `C` alone.
# How many products of blocks do you need?

# %% [markdown] tags=["solution"]
# Three: two with `B`, one with `C`, none with 0.

# %% tags=["solution"]
rng = np.random.default_rng(1)
B, C, x = rng.random((2, 2)), rng.random((2, 2)), rng.random(4)
P = np.block([[B, np.zeros((2, 2))], [C, B]])
assert np.allclose(P @ x, np.concatenate([B @ x[:2], C @ x[:2] + B @ x[2:]]))

# %% [markdown]
# **Exercise 3.** The components are not independent any more: the first one (the first bit) is
# repaired only while all others work. So of the lower left quarter of `components(k)`, only the
# entry in its first row and first column remains. Count the blocks for $k = 2, \ldots, 8$. Does the
# matrix still compress?

# %% [markdown] tags=["solution"]
# It does. A block with one number in its upper left corner has such a block as its upper left
# quarter, and zeros elsewhere. So this is one more kind of block at each level, where the number of
# blocks grows by four instead of three: $4k-2$. A condition on all components is a small diagram if
# it is regular.


# %% tags=["solution"]
def repaired_last(k):
    matrix, half = components(k), 2 ** (k - 1)
    matrix[half:, :half] = 0
    matrix[half, 0] = 5
    return matrix


counts = []
for k in range(2, 9):
    table = {}
    store(repaired_last(k), table)
    counts.append(len(table))
print(counts)
assert counts == [4 * k - 2 for k in range(2, 9)]

# %% [markdown]
# **Exercise 4.** Which models suit diagrams? Compare the number of states with the nodes of their
# BDD (`symcheck.reach(symcheck.build(model.bound, symcheck.Options()))` has `count` and
# `states.node_count`) for `die/die.pm`, `crowds/crowds.pm` with `TotalRuns=3` and `CrowdSize=5`,
# `kanban/kanban.sm` with `t=3`, and `tandem/tandem.sm` with `c=255`. What do you expect of the
# cell-injection robot of lesson 9?

# %% [markdown] tags=["solution"]
# Queues and lines of machines are regular: a few nodes for many states. The die needs nearly a node
# per state. The states of the robot are positions and forces that random noise brings about, and
# they depend on each other in no simple way: its BDD has 1.4 nodes *per state* (273 051 for 194 042
# states), and explicit search is the better choice.

# %% tags=["solution"]
for file, constants in (
    ("die/die.pm", {}),
    ("crowds/crowds.pm", {"TotalRuns": 3, "CrowdSize": 5}),
    ("kanban/kanban.sm", {"t": 3}),
    ("tandem/tandem.sm", {"c": 255}),
):
    model = symcheck.load(f"../models/{file}", constants=constants)
    space = symcheck.reach(symcheck.build(model.bound, symcheck.Options()))
    print(f"{file:18} {space.count:7,} states, {space.states.node_count:4} nodes")
