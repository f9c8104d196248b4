"""A bound model compiled to plain arrays, on which the compiled exploration works."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import reduce
from math import inf

import numpy as np
from numpy.typing import NDArray

from symcheck.explicit import tuning
from symcheck.explicit.assembler import Assembler, Register, is_constant
from symcheck.explicit.candidates import Forest, Masks, all_of, any_of, guard_masks
from symcheck.explicit.code_generation import CodeGenerator
from symcheck.explicit.decider import Decider
from symcheck.explicit.states import StateLayout
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Int32s, Int64s
from symcheck.semantics.model import BoundCommand, BoundModel, BoundReward, BoundUpdate
from symcheck.semantics.state_faults import sum_tolerance
from symcheck.syntax.ast import Binary, Conditional, Expression, Literal, Name, Type
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import conjuncts

__all__ = ["CompiledModel", "compile_model"]

Assignments = Sequence[tuple[int, Expression]]
_ALL = (1 << 64) - 1


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class CompiledModel:
    """A compiled model, as `symcheck.kernels.explore.breadth_first.Expander` reads it.

    Commands, updates and assignments are numbered consecutively; `x_ys[i]` to `x_ys[i+1]` are the
    ys of x number i. Codes are indices into `program` (-1: none), registers are indices into the
    register file `slots`.

    Attributes:
        command_guard: code that ends with DONE where the command is enabled (of synchronised
            commands only).
        command_code: code that checks the guard and computes the probabilities, and also the new
            values where all probabilities are constants.
        update_keep: a bit for each bit of the state that the update keeps.
        update_preset: the new values that are constants; the others are assignments.
        action_rewards: entry a+1 (a: index of the event's action, -1: none) is the first of its
            rows in `rewards`.
        rewards: rows (structure, code, register).
        decider: makes the decisions that rounding errors leave open.
        markovian: the number of events that take no time in a Markov automaton; all others race.
    """

    kind: int
    markovian: int
    words: int
    tolerance: float
    check_sums: bool
    fields: NDArray[np.int32]
    lows: Int64s
    ranges: NDArray[np.uint64]
    program: NDArray[np.int32]
    slots: Int64s
    command_guard: Int32s
    command_code: Int32s
    command_updates: Int32s
    update_probability: Int32s
    update_code: Int32s
    update_assignments: Int32s
    update_keep: NDArray[np.uint64]
    update_preset: NDArray[np.uint64]
    assignment_register: Int32s
    assignment_variable: Int32s
    event_action: Int32s
    event_parts: Int32s
    part_commands: Int32s
    part_list: Int32s
    part_forest: Int32s
    forest: Int32s
    root: int
    action_rewards: Int32s
    rewards: NDArray[np.int32]
    structures: int
    most_updates: int
    most_commands: int
    most_parts: int
    decider: Decider


def compile_model(
    model: BoundModel,
    layout: StateLayout,
    *,
    check_sums: bool = True,
    separate_choices: bool = False,
) -> CompiledModel:
    """Compile a model for `symcheck.kernels.explore`.

    Args:
        model: the model.
        layout: how the states are packed.
        check_sums: check that the probabilities of each choice sum to 1 (never done for the rates
            of a CTMC).
        separate_choices: give each joint choice a row of its own, as in an MDP, also in a DTMC or
            CTMC.
    """
    rows = 2 if separate_choices or model.type.has_choices else int(model.type.continuous_time)
    if rows == 2 and model.type.immediate_choices and not separate_choices:
        rows = 3
    return _Builder(model, layout).build(rows, check_sums)


_STARTS = ("command_updates", "update_assignments", "event_parts", "part_commands")
_REGISTERS = ("update_probability", "assignment_register")
_LISTS = (
    *("command_guard", "command_code", "update_code", "assignment_variable"),
    *("event_action", "part_list", "part_forest", *_REGISTERS),
)


class _Builder:
    def __init__(self, model: BoundModel, layout: StateLayout) -> None:
        self.model = model
        self.layout = layout
        self.assembler = Assembler(len(model.variables))
        self.generator = CodeGenerator(self.assembler, model.variables)
        self.index = {v.name: i for i, v in enumerate(model.variables)}
        self.fails = self.assembler.label()
        self.assembler.place(self.fails)
        self.assembler.fail()
        self.synchronised = {
            id(c)
            for e in model.events
            if len(e.participants) > 1
            for p in e.participants
            for c in p
        }
        self.numbers: dict[int, int] = {}  # id of a command -> its number
        # The int32 arrays of the tables, by name.
        self.lists: dict[str, list[int]] = {name: [] for name in _LISTS} | {
            name: [0] for name in _STARTS
        }
        self.keep: list[list[int]] = []
        self.preset: list[list[int]] = []

    def build(self, kind: int, check_sums: bool) -> CompiledModel:
        forest = Forest(self.layout.lows.tolist())
        root = self.events(forest)
        action_rewards, rewards, structures = self.rewards()
        self.assembler.halt()
        program, slots = self.assembler.finish()
        place = self.assembler.place_of
        lists = self.lists | {name: list(map(place, self.lists[name])) for name in _REGISTERS}
        sizes = [
            [sum(len(c.updates) for c in p) for p in e.participants] for e in self.model.events
        ]
        return CompiledModel(
            kind=kind,
            markovian=sum(not e.is_markovian for e in self.model.events),
            words=self.layout.words,
            tolerance=sum_tolerance(self.model.unchecked_sums),
            check_sums=check_sums and self.model.type.has_probabilities,
            fields=self.layout.fields,
            lows=self.layout.lows,
            ranges=self.layout.ranges,
            program=program,
            slots=slots,
            update_keep=np.array(self.keep, np.uint64).reshape(-1, self.layout.words),
            update_preset=np.array(self.preset, np.uint64).reshape(-1, self.layout.words),
            **{name: _ints(values) for name, values in lists.items()},
            forest=forest.array(),
            root=root,
            action_rewards=_ints(action_rewards),
            rewards=_ints([[s, c, place(r)] for s, c, r in rewards]).reshape(-1, 3),
            structures=structures,
            most_updates=max(map(sum, sizes), default=0),
            most_commands=max(
                (sum(map(len, e.participants)) for e in self.model.events), default=0
            ),
            most_parts=max((len(e.participants) for e in self.model.events), default=1),
            decider=self.generator.decider,
        )

    # --------------------------------------------------------------------------------------- events

    def events(self, forest: Forest) -> int:
        """Fill the lists of the events; returns the root of the forest over the events."""
        lists = self.lists
        actions = {a: i for i, a in enumerate(self.model.actions)}
        known: dict[int, Masks] = {}
        many = len(self.model.events) >= tuning.MIN_FOREST_ITEMS
        event_masks: list[Masks] = []
        for event in self.model.events:
            lists["event_action"].append(-1 if event.action is None else actions[event.action])
            lists["event_parts"].append(lists["event_parts"][-1] + len(event.participants))
            part_masks = [
                [
                    self.masks(c, known) if many or len(p) >= tuning.MIN_FOREST_ITEMS else {}
                    for c in p
                ]
                for p in event.participants
            ]
            for commands, of_commands in zip(event.participants, part_masks, strict=True):
                numbers = [self.command(c) for c in commands]
                lists["part_list"].extend(numbers)
                lists["part_commands"].append(len(lists["part_list"]))
                is_unique = len(set(numbers)) == len(numbers)
                worth = is_unique and len(numbers) >= tuning.MIN_FOREST_ITEMS
                lists["part_forest"].append(forest.add(numbers, of_commands) if worth else -1)
            event_masks.append(all_of([any_of(m) for m in part_masks]))
        return forest.add(range(len(self.model.events)), event_masks)

    def masks(self, command: BoundCommand, known: dict[int, Masks]) -> Masks:
        if id(command) not in known:
            known[id(command)] = guard_masks(command.guard, self.model.variables, self.index)
        return known[id(command)]

    # ------------------------------------------------------------------------------------- commands

    def command(self, command: BoundCommand) -> int:
        """The number of a command; its code is written on the first call."""
        if id(command) not in self.numbers:
            self.numbers[id(command)] = len(self.lists["command_guard"])
            self.lists["command_guard"].append(self.assembler.position)
            if id(command) in self.synchronised:
                self.assembler.forget()
                self.guarded(command.guard)
                self.assembler.halt()
            self.lists["command_code"].append(self.assembler.position)
            self.assembler.forget()
            self.guarded(command.guard)
            self.effects(command.updates)
        return self.numbers[id(command)]

    def guarded(self, guard: Expression) -> None:
        """Write code that ends with DISABLED unless the guard holds.

        Cheap conjuncts that always have a value come first.
        """
        generator = self.generator

        def cost(part: Expression) -> float:
            return generator.cost(part) if generator.total(part) else inf

        for part in sorted(conjuncts(guard), key=cost):
            generator.jump(part, False, self.fails)

    def effects(self, updates: tuple[BoundUpdate, ...]) -> None:
        """Write code for the probabilities and, in the same run if these are constants, for the new
        values.
        """
        assembler = self.assembler
        probabilities = [self.generator.real(u.probability) for u in updates]
        at_once = all(is_constant(p) and assembler.bits(p) > 0 for p in probabilities)
        if not at_once:
            assembler.halt()
        for update, probability in zip(updates, probabilities, strict=True):
            self.lists["update_probability"].append(probability)
            start = assembler.position
            if at_once:
                self.assign(update.assignments)
            else:
                with assembler.scope():
                    self.assign(update.assignments)
            written = assembler.position > start
            if written and not at_once:
                assembler.halt()
            self.lists["update_code"].append(start if written and not at_once else -1)
        if at_once:
            assembler.halt()
        self.lists["command_updates"].append(len(self.lists["update_probability"]))

    def assign(self, assignments: Assignments) -> None:
        """Code for the new values of one update."""
        keep, preset = [_ALL] * self.layout.words, [0] * self.layout.words
        for v, expression in assignments:
            if isinstance(expression, Name) and self.index[expression.name] == v:
                continue
            _, word, shift, bits = self.layout.fields[v].tolist()
            keep[word] &= ~(((1 << bits) - 1) << shift)
            register, _ = self.generator.value(expression)
            code = -1
            if is_constant(register):
                code = self.assembler.bits(register) - int(self.layout.lows[v])
            if 0 <= code <= int(self.layout.ranges[v]):
                preset[word] |= code << shift
            else:
                self.lists["assignment_register"].append(register)
                self.lists["assignment_variable"].append(v)
        self.lists["update_assignments"].append(len(self.lists["assignment_register"]))
        self.keep.append(keep)
        self.preset.append(preset)

    # -------------------------------------------------------------------------------------- rewards

    def rewards(self) -> tuple[list[int], list[tuple[int, int, Register]], int]:
        """Write code for the transition rewards of each action; structures that have some are
        numbered.
        """
        having = [r for r in self.model.rewards if any(not i.on_states for i in r.items)]
        starts, result = [0], []
        for action in (None, *self.model.actions):
            for number, structure in enumerate(having):
                items = [i for i in structure.items if not i.on_states and i.action == action]
                if items:
                    start = self.assembler.position
                    self.assembler.forget()
                    register = self.generator.real(total_reward(items))
                    self.assembler.halt()
                    result.append((number, start, register))
            starts.append(len(result))
        return starts, result, len(having)


def total_reward(items: Sequence[BoundReward]) -> Expression:
    """The sum of the items that apply, as one expression of type double."""
    zero: Expression = Literal(Fraction(0), Type.DOUBLE)
    terms: list[Expression] = [Conditional(i.guard, i.value, zero) for i in items]
    return reduce(lambda a, b: Binary(Operator.PLUS, a, b), terms) if terms else zero


def _ints(values: Sequence[object]) -> NDArray[np.int32]:
    return np.array(values, np.int32)
