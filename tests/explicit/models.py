"""Random small models as texts, for comparison with the scalar semantics."""

from __future__ import annotations

from hypothesis import strategies as st

TYPES = ("dtmc", "ctmc", "mdp")


@st.composite
def models(draw, types=TYPES, faults=True):
    """A model text: one to three modules, shared actions, globals, overlapping guards, rewards; rarely a fault."""
    kind = draw(st.sampled_from(types))
    ints, bools, lines = [], [], [kind]
    if draw(st.booleans()):
        lines.append("global g : [0..2] init 1;")
        ints.append(("g", 0, 2))
    modules = []
    for m in range(draw(st.integers(1, 3))):
        own = []
        for k in range(draw(st.integers(1, 2))):
            name = f"v{m}{k}"
            if draw(st.integers(0, 3)) == 0:
                own.append((name, None, None))
                bools.append(name)
            else:
                low = draw(st.integers(-1, 1))
                high = low + draw(st.integers(1, 3))
                own.append((name, low, high))
                ints.append((name, low, high))
        modules.append(own)
    for m, own in enumerate(modules):
        lines.append(f"module m{m}")
        lines += [
            f"  {n} : {'bool' if low is None else f'[{low}..{high}]'};" for n, low, high in own
        ]
        for _ in range(draw(st.integers(1, 7))):
            lines.append("  " + draw(_command(kind, own, ints, bools, faults)))
        lines.append("endmodule")
    if draw(st.booleans()):
        lines += ['rewards "r"', f"  {draw(_guard(ints, bools))} : {draw(_int(ints))} + 0.5;"]
        lines += [
            f"  [{a}] {draw(_guard(ints, bools))} : {draw(_int(ints))};"
            for a in draw(st.sampled_from([["a"], ["", "b"], []]))
        ]
        lines += ["endrewards", "rewards", "  [a] true : 2;", "  true : 1;", "endrewards"]
    if draw(st.integers(0, 3)) == 0:
        lines += [f"init {draw(_guard(ints, bools))} endinit"]
        lines = [line.replace(" init 1;", ";") for line in lines]
    return "\n".join(lines)


def _int(ints):
    leaves = (
        st.one_of(st.integers(-1, 3).map(str), st.sampled_from([n for n, _, _ in ints]))
        if ints
        else st.integers(-1, 3).map(str)
    )
    return st.one_of(
        leaves,
        st.tuples(leaves, st.sampled_from("+-*"), leaves).map(lambda t: f"({t[0]}{t[1]}{t[2]})"),
        leaves.map(lambda x: f"mod({x}, 3)"),
        leaves.map(lambda x: f"floor({x}/2)"),
    )


def _atom(ints, bools):
    choices = [st.just("true")]
    if ints:
        choices += [
            st.tuples(
                st.sampled_from(ints), st.sampled_from(["=", "!=", "<", ">="]), st.integers(-1, 3)
            ).map(lambda t: f"{t[0][0]}{t[1]}{t[2]}")
        ] * 3
        choices.append(st.tuples(_int(ints), _int(ints)).map(lambda t: f"{t[0]}<={t[1]}"))
    if bools:
        choices.append(st.tuples(st.sampled_from(["", "!"]), st.sampled_from(bools)).map("".join))
    return st.one_of(*choices)


def _guard(ints, bools):
    atom = _atom(ints, bools)
    return st.one_of(
        atom,
        st.tuples(atom, atom).map(" & ".join),
        st.tuples(atom, atom).map(lambda t: f"({t[0]} | {t[1]})"),
        st.tuples(atom, atom, atom).map(lambda t: f"{t[0]} & ({t[1]} => {t[2]})"),
    )


@st.composite
def _command(draw, kind, own, ints, bools, faults):
    action = draw(st.sampled_from(["", "", "a", "b"]))
    assigned = own + ([("g", 0, 2)] if action == "" and ("g", 0, 2) in ints else [])
    n = draw(st.integers(1, 3))
    targets = [draw(_update(assigned, ints, bools, faults)) for _ in range(n)]
    if kind == "ctmc":
        weights = [
            draw(
                st.one_of(
                    st.sampled_from(["1", "0.5", "3"]), _int(ints).map(lambda x: f"max(0, {x})*0.7")
                )
            )
            for _ in range(n)
        ]
    else:
        weights = {1: ["1"], 2: ["0.3", "0.7"], 3: ["1/3", "1/3", "1-2/3"]}[n]
        if n == 2 and ints and draw(st.integers(0, 2)) == 0:
            name, low, high = draw(st.sampled_from(ints))
            weights = [f"({name}-{low})/{high - low}", f"1-({name}-{low})/{high - low}"]
        if faults and draw(st.integers(0, 150)) == 0:
            weights = ["0.2", *weights[1:]]
    right = " + ".join(f"{w} : {t}" for w, t in zip(weights, targets, strict=True))
    return f"[{action}] {draw(_guard(ints, bools))} -> {right};"


@st.composite
def _update(draw, assigned, ints, bools, faults):
    chosen = draw(st.lists(st.sampled_from(assigned), min_size=1, max_size=2, unique=True))
    parts = []
    for name, low, high in chosen:
        if low is None:
            parts.append(f"({name}'={draw(_guard(ints, bools))})")
        elif faults and draw(st.integers(0, 60)) == 0:
            parts.append(f"({name}'={draw(_int(ints))})")
        else:
            parts.append(f"({name}'=min(max({draw(_int(ints))}, {low}), {high}))")
    return draw(st.sampled_from([" & ".join(parts)] * 5 + ["true"]))
