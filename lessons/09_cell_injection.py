# %% [markdown]
# # Lesson 9: A study: the cell-injection robot
# After this lesson you can read a model of a controlled system, check its properties for many
# settings in one call, and report results with their accuracy.
#
# Time: 40 minutes. You need lessons 2 to 4.
#
# A motorised stage drives a needle towards a cell, in a closed loop of reference, force, torque,
# motion and noise. A published paper, *Formal Verification of a Fully Automated Out-of-Plane Cell
# Injection System*, analysed the loop with PRISM, and allowed it 512 GB of memory. [The
# report](../docs/cell_injection.md) compares the paper's ranges with ours, and names each detail
# that the paper leaves open. The mechanics are from H. Huang, D. Sun, J. K. Mills, W. J. Li and S.
# H. Cheng, *Visual-based impedance control of out-of-plane cell injection systems*, IEEE
# Transactions on Automation Science and Engineering 6(3), 2009.
#
# In this lesson you work as one does in a study: load, look, understand, check, vary, and say what
# the numbers are worth.

# %%
import math
from pathlib import Path

import matplotlib.pyplot as plt
import symcheck

folder = Path("../models/cell_injection")
constants = {
    "CellBoundaryX": 175,
    "CellBoundaryY": 175,  # where the cell begins, in micrometres
    "InitialPositionXY": 100,
    "MaxDistance": 250,  # where the stage begins and ends
    "StepSizeXY": 18,  # how far the reference moves in a loop
    "NoisePercentage": 0.01,  # the standard deviation, as a share of the position
    "Damping": 1,  # the sign of the damping: 1 is the right one
}
robot = symcheck.load(
    folder / "cell_injection.pm", constants=constants, engine="explicit", reduce=True
)
print(robot)
print([variable.name for variable in robot.variables])

# %% [markdown]
# Two options are worth a word. `engine="explicit"` explores state by state, because these states
# have little structure for diagrams (lesson 8). `reduce=True` resets a variable whenever no later
# step reads it; this keeps all values.
#
# ## The loop
# Do not begin with a probability. Begin with a path: does the model do what you think it does?
# `count` is the phase of the loop: the reference advances (0), the force is measured (1), the stage
# moves (2), and noise falls on each axis (3 and 4). The path below shows a row after each
# measurement of the force.
#
# *Before you run the cell:* the needle starts at 100 and moves by about 18 in each loop. In which
# loop does it touch the cell?

# %%
path = robot.simulate(40, seed=3).to_frame()
measured = path[path.action.isin(["force", "punctured"])]
measured[["action", "k", "X_cur", "X_n", "Y_cur", "Y_n", "Force"]]

# %% [markdown]
# `X_cur` is where the mechanics brought the needle, and `X_n` is where it is seen to be after the
# noise. Noise is one of three shifts: back by 1 % of the position (rounded up), none, or forward.
# Both axes do the same, with noise of their own, so they drift apart by some micrometres. After
# five moves, in the sixth loop, both are beyond 175, and there is a force for the first time. The
# force is 249, then 207: it *falls* although the needle is deeper. In the last row the membrane
# gives way.
#
# ## The force law
# Why does the force fall? The model has the law in its module `controller`: the depth is a
# distance, rounded up, and the force is linear in it up to 40, and quadratic above. We write it
# down again in Python:


# %%
def depth(x, y):
    beyond_x, beyond_y = max(x - 175, 0), max(y - 175, 0)
    return math.ceil(1.2247 * math.hypot(beyond_x, beyond_y))


def force(deep):
    if deep <= 40:
        return math.ceil(8.5714 * deep)
    return math.ceil(0.02274 * deep**2 - 0.09252 * deep + 95.31)


deep = [depth(194, 188), depth(214, 218)]
print("depths:", deep, "forces:", [force(d) for d in deep])
assert [force(d) for d in deep] == [249, 207]

# %% [markdown]
# Two samples agree. With a state space at hand, one can do better than samples: compare the law
# with *all* states in which the force has just been measured.

# %%
states = robot.states.to_frame()
after = states[states["count"] == 2]
touching = (after.X_n > 175) & (after.Y_n > 175)
ours = [force(depth(x, y)) if touch else 0 for x, y, touch in zip(after.X_n, after.Y_n, touching)]
assert (after.Force == ours).all()
print(f"{len(after):,} of {len(states):,} states compared")

# %% [markdown]
# Now you know the law, and a plot of it tells more than the text of the model did. A cell ruptures
# if the force exceeds 300 (dashed).
#
# *Before you run the cell:* at which depths does the cell rupture? Guess first, from the two forces
# above.

# %%
depths = range(1, 96)
figure, axes = plt.subplots(figsize=(6.4, 3))
axes.plot(depths, [force(d) for d in depths], ".", markersize=4)
axes.axhline(300, linestyle="--", linewidth=0.8, color="black")
axes.set(xlabel="depth", ylabel="force", ylim=0)
dangerous = [d for d in depths if force(d) > 300]
print("rupture at depths", dangerous)
assert dangerous == [36, 37, 38, 39, 40]

# %% [markdown]
# Only in a narrow window, from 36 to 40! Deeper, the other branch of the law begins with a small
# force. So a rupture is a matter of *bad luck with sampling*: some measurement has to fall into the
# window of five micrometres, between two steps of more than thirty along the needle. Keep this in
# mind; it explains all that follows.
#
# ## Properties
# The properties of the study are in a file. Their labels name what a user of the robot fears:
#
# | property | question |
# |---|---|
# | `position_error` | are both axes more than 7 % off the reference at once? |
# | `force_error` | is the force off the desired one by more than `ForceBound` percent? |
# | `stages`, `stages_in_order` | does each path pass piercing and end in the injection (two readings of one formula)? |
# | `rupture_in_piercing`, `rupture_in_injection` | is the force above 300 in this stage? |
# | `poor` | is the force too small at the depth 95, where the membrane gives way? |
# | `injected` | is the injection reached? |
#
# `check_all` checks a file. The constant `ForceBound` belongs to the file, not to the model.

# %%
found = {}
for bound, result in robot.check_all(folder / "cell_injection.pctl", {"ForceBound": 10}):
    found[bound.name] = result
    print(f"{bound.name:21} {result}")
assert abs(found["rupture_in_piercing"].value - 0.0712983912) < 1e-9
assert all(found[name].value == 1 for name in ("stages", "stages_in_order", "injected"))

# %% [markdown]
# Read the words in parentheses. `exact` values are 1 or true by graph analysis: every path, except
# for a set of probability 0, reaches the injection. `exact up to rounding` values were computed by
# elimination, with bounds for the rounding (lesson 4):

# %%
lower, upper = found["rupture_in_piercing"].bounds
print(lower, "<= value <=", upper)
assert upper - lower < 1e-12

# %% [markdown]
# The paper reports position errors of about 0.2 and ruptures below 0.15; the values here, 0.18 and
# 0.07, fit.
#
# One result looks odd: how can a cell rupture during the *injection*, when the force law is not
# used any more? `Force` keeps its value until the next measurement. In the path above it is 249
# while the stage moves on to 217 and 215, and 207 while it moves on to 239 and 249, deep in the
# cell. So this property tells whether the *last* measurement before the injection was too large. A
# surprising number is a reason to read the definition.
#
# ## More noise, more risk?
# `symcheck.experiment` varies a constant and returns rows, with a data frame and plots. Here are
# all properties under two levels of noise. *Before you run the cell:* which of the properties get
# worse with more noise?

# %%
rows = symcheck.experiment(
    folder / "cell_injection.pm",
    folder / "cell_injection.pctl",
    constants={**constants, "ForceBound": 10, "NoisePercentage": [0.005, 0.01]},
    engine="explicit",
    reduce=True,
)
assert not rows.errors
table = rows.to_frame().pivot(index="property", columns="NoisePercentage", values="value")
table

# %% [markdown]
# Errors and ruptures get worse, by factors from 2 to 4.5. But `poor` gets *better*: it needs a
# position of exactly the depth 95 and too small a force, and with less noise more paths have one.
# Noise does not simply do harm; it decides which depths are sampled.

# %%
assert 2 < table[0.01]["position_error"] / table[0.005]["position_error"] < 2.1
assert 4.4 < table[0.01]["rupture_in_piercing"] / table[0.005]["rupture_in_piercing"] < 4.6
assert table[0.01]["poor"] < table[0.005]["poor"] / 2

# %% [markdown]
# ## The step size
# A larger step reaches the cell sooner. Does it also rupture more cells? The paper has one step
# size, 18. Try a range; a property may be given as a text instead of a file.

# %%
rupture = '"rupture": P=? [ F "piercing" & "cell_rupture" ];'
steps = symcheck.experiment(
    folder / "cell_injection.pm",
    rupture,
    constants={**constants, "StepSizeXY": range(16, 25)},
    engine="explicit",
    reduce=True,
)
steps.plot(x="StepSizeXY").set_ylim(0)
plt.show()
# %% [markdown]
# The probability goes up and down, between 4 % and 50 %. There is no law "larger is worse". The
# window of depths explains it. The reference is at 100, 100 + step, 100 + 2 step, …; here are its
# depths in the cell, with the probability:

# %%
by_step = {row.constants["StepSizeXY"]: row.value for row in steps}
for step, probability in by_step.items():
    reference = [100 + step * k for k in range(1, 10) if 175 < 100 + step * k < 250]
    print(step, [depth(x, x) for x in reference][:3], f"{probability:.3f}")
assert max(by_step, key=by_step.get) == 24
assert min(by_step, key=by_step.get) == 22
assert depth(196, 196) == 37

# %% [markdown]
# With step 24 (and also with 16) the reference itself is at the depth 37, in the middle of the
# window. With step 22 it jumps from 23 to 61, far from the window on both sides. For step 18, noise
# has to carry the needle from 26 up to 36, or from 58 down to 40. A study of one or two step sizes
# would have found *some* number, and no understanding.
#
# ## What the numbers are worth
# Each value is certain to twelve digits, **for this model**. The model has constants that the paper
# does not print; lines marked with [C] in its text are choices of ours. The threshold 300 and the
# depths 40 and 95 were *fitted* to the ranges that the paper reports. So that the rupture
# probability agrees with the paper is no evidence for the model: it was made to agree.
#
# How much depends on a choice can be measured. The threshold is a constant with a value, so we
# change the text:

# %%
text = (folder / "cell_injection.pm").read_text()
assert text.count("Force_threshold = 300") == 1
risk = {}
for threshold in (280, 300, 320):
    changed = text.replace("Force_threshold = 300", f"Force_threshold = {threshold}")
    model = symcheck.loads(changed, constants, engine="explicit", reduce=True)
    risk[threshold] = model.check('P=? [ F "piercing" & "cell_rupture" ]').value
    print(threshold, f"{risk[threshold]:.3f}")
assert risk[280] > 2.5 * risk[300]

# %% [markdown]
# A threshold that is 7 % lower gives nearly three times the risk. A report should therefore have
# the value, its accuracy, *and* such a sensitivity. "0.0712983912, exact up to rounding, for the
# threshold 300; 0.040 to 0.195 for thresholds from 320 to 280" is a good sentence.
#
# Some of the work is to keep results right while models change. The file of properties has comments
# `// RESULT: …` with expected values, most of which another model checker computed too, and `test`
# compares:

# %%
tests = robot.test(folder / "cell_injection.pctl", {"ForceBound": 10})
print("passed:", len(tests) - len(tests.failed), "failed:", len(tests.failed))
assert tests.ok

# %% [markdown]
# ## Summary
# - Look at paths first, then compare your understanding with all states.
# - `check_all` checks a file, `experiment` varies constants, `test` compares with expected results.
# - A probability need not be monotone in a parameter; vary it over a range and look for the
#   mechanism.
# - Accuracy is a statement about the computation. What the model leaves out, and what was fitted,
#   belongs into the report too.

# %% [markdown]
# ## Exercises

# %% [markdown]
# **Exercise 1.** The paper found an error in the damping of an earlier design. With the wrong sign
# and without clamping to the stage, `Damping=-1`, the needle leaves the stage. How does symcheck
# tell? Load the model with this constant, ask for its `engine`, and read the message.

# %% [markdown] tags=["solution"]
# It is an error with the command and the state in which it happens. The very first motion brings
# the needle to 94, behind the start.

# %% tags=["solution"]
try:
    symcheck.load(folder / "cell_injection.pm", constants={**constants, "Damping": -1}).engine
    raise AssertionError("expected an error")
except symcheck.SymcheckError as error:
    print(error)

# %% [markdown]
# **Exercise 2.** Estimate the rupture probability from 2 000 paths with
# `robot.estimate(…, samples=2_000, seed=1)`. How many paths would give it with an error of at most
# 0.0005, with probability 0.99? (A normal distribution is within 2.58 standard deviations with this
# probability; the standard deviation of the mean of $n$ samples is $\sqrt{p(1-p)/n}$.)

# %% [markdown] tags=["solution"]
# The error falls with the square root of the number of paths: 2 000 give 0.015, so a thirtieth of
# it takes 900 times as many, 1.8 million. Elimination has twelve digits in about a second.

# %% tags=["solution"]
estimate = robot.estimate('P=? [ F "piercing" & "cell_rupture" ]', samples=2_000, seed=1)
print(estimate)
p = found["rupture_in_piercing"].value
needed = 2.58**2 * p * (1 - p) / 0.0005**2
print(f"{needed:,.0f} paths")
assert estimate.bounds[0] <= p <= estimate.bounds[1]
assert 1.7e6 < needed < 1.8e6

# %% [markdown]
# **Exercise 3.** With step 24, the reference is in the middle of the window. What do you expect of
# more noise there: more ruptures or fewer? Run an experiment with 0.25 %, 0.5 %, 1 % and 2 %. Why
# do the first two give the same value?

# %% [markdown] tags=["solution"]
# Fewer: noise is what carries the needle *out of* the window. The first two are equal because the
# noise is rounded up to whole micrometres. Up to the position 200, both 0.25 % and 0.5 % are 1
# micrometre, and the window is passed before. A discretisation may hide a parameter; here it does.

# %% tags=["solution"]
noise = symcheck.experiment(
    folder / "cell_injection.pm",
    rupture,
    constants={**constants, "StepSizeXY": 24, "NoisePercentage": [0.0025, 0.005, 0.01, 0.02]},
    engine="explicit",
    reduce=True,
)
values = [row.value for row in noise]
for row in noise:
    print(row.constants["NoisePercentage"], f"{row.value:.4f}", f"{row.states:,} states")
assert abs(values[0] - values[1]) < 1e-9
assert values[1] > values[2] > values[3]

# %% [markdown]
# **Exercise 4.** How many states does `reduce` save, for the rupture property alone and for the
# whole file? Run experiments with `reduce=True` and `reduce=False` and compare `states` of the
# first row. Why does the number depend on the properties?

# %% [markdown] tags=["solution"]
# It saves some 10 % only. This model was written with few variables; a version with a variable for
# each quantity of the paper shrinks to less than a third (see the report). A variable may be reset
# if no later step *and no property* reads it before it is written again, so more properties may
# leave more states.

# %% tags=["solution"]
counts = []
for reduce, properties, more in (
    (False, rupture, {}),
    (True, rupture, {}),
    (True, folder / "cell_injection.pctl", {"ForceBound": 10}),
):
    run = symcheck.experiment(
        folder / "cell_injection.pm",
        properties,
        constants={**constants, **more},
        engine="explicit",
        reduce=reduce,
    )
    counts.append(run[0].states)
print(counts)
assert counts == [194_042, 175_089, 176_068]
