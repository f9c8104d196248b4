"""Assembler for the register machine (`symcheck.kernels.explore.register_machine`): registers,
constants, jumps, and common subexpressions.

While a program is written, a register is one int: variables count from 0, constants from CONSTANTS,
temporaries from TEMPORARIES. `finish` numbers them consecutively, with the constants preset in the
register file.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.explore.register_machine import Op, evaluate
from symcheck.matrices.rows import Int64s

__all__ = ["Assembler", "Register", "is_constant"]

Register = int
CONSTANTS = 1 << 24
TEMPORARIES = 1 << 25
_NONE = -1  # an operand that the operation does not have


def is_constant(register: Register) -> bool:
    """Whether the register holds a constant."""
    return CONSTANTS <= register < TEMPORARIES


def _bits(value: bool | int | float) -> int:
    if isinstance(value, float):
        return int(struct.unpack("q", struct.pack("d", value))[0])
    return int(value)


class Assembler:
    """A program under construction.

    Equal instructions on equal registers are written once where the first is always executed before
    the second: `scope` marks code that may be jumped over, whose values must not be used after it.

    Args:
        variables: number of variable registers.
    """

    def __init__(self, variables: int) -> None:
        self._variables = variables
        self._code: list[tuple[int, int, int, int]] = []
        self._constants: dict[int, Register] = {}  # bits of the value -> register
        self._values: list[int] = []
        self._temporaries = 0
        self._most_temporaries = 0
        self._labels: list[int] = []
        self._barrier = 0  # the last position that a jump may lead to
        self._known: dict[object, Register] = {}

    # ------------------------------------------------------------------------------------ registers

    def constant(self, value: bool | int | float) -> Register:
        """The register of a constant; equal bits share one. Raises OverflowError beyond 64 bits."""
        bits = _bits(value)
        if not -(2**63) <= bits < 2**63:
            raise OverflowError(f"{value} does not fit 64 bits")
        return self._constant(bits)

    def _constant(self, bits: int) -> Register:
        if bits not in self._constants:
            self._constants[bits] = CONSTANTS + len(self._values)
            self._values.append(bits)
        return self._constants[bits]

    def bits(self, register: Register) -> int:
        """The bits of a constant, as int64."""
        return self._values[register - CONSTANTS]

    def temporary(self) -> Register:
        """A new temporary."""
        self._temporaries += 1
        self._most_temporaries = max(self._most_temporaries, self._temporaries)
        return TEMPORARIES + self._temporaries - 1

    def forget(self) -> None:
        """Begin a piece of code that shares no temporary with the code before."""
        self._known = {}
        self._temporaries = 0

    @contextmanager
    def scope(self) -> Iterator[None]:
        """Context of code that may be jumped over."""
        outer = self._known
        self._known = dict(outer)
        yield
        self._known = outer

    # ----------------------------------------------------------------------------------------- code

    @property
    def position(self) -> int:
        """Index of the next instruction."""
        return len(self._code)

    def emit(self, op: Op, a: Register, b: Register = _NONE) -> Register:
        """Write an operation on registers; returns the register of its value.

        That is an earlier register, or a constant, where the value is known.
        """
        key = (int(op), a, b)
        if (result := self._known.get(key)) is not None:
            return result
        folded = self._fold(op, a, b) if is_constant(a) and (is_constant(b) or b == _NONE) else None
        if folded is None:
            folded = self.temporary()
            self._code.append((int(op), folded, a, b))
        self._known[key] = folded
        return folded

    def ask(self, op: Op, a: Register, b: Register, number: int) -> Register:
        """Write a decision on a double and a bound on its error; returns the answer's register.

        number: of the decision, for the decider.
        """
        key = (int(op), a, b, number)
        if (result := self._known.get(key)) is None:
            result = self._known[key] = self.temporary()
            self._code.append((int(op), result, a, b))
            self._code.append((int(Op.ASK), result, number, _NONE))
            self._barrier = len(self._code)  # both write the answer
        return result

    def recall(self, key: object) -> Register | None:
        """The register noted by `remember` for a key, where it is still valid."""
        return self._known.get(key)

    def remember(self, key: object, register: Register) -> None:
        """Note that a register holds a value, such as that of a whole expression."""
        self._known[key] = register

    def _fold(self, op: Op, a: Register, b: Register) -> Register | None:
        """The constant that the machine computes; None where it fails, as it then does when it
        runs.
        """
        registers = np.array([self.bits(a), self.bits(b) if b != _NONE else 0, 0], np.int64)
        code = np.array([(op, 2, 0, 1), (Op.HALT, 0, 0, 0)], np.int32)
        failed = evaluate(code, registers)
        return None if failed else self._constant(int(registers[2]))

    def move(self, destination: Register, source: Register, start: int) -> None:
        """Set a destination to a source.

        start: position since which a scope is open that closes directly after this.
        """
        last = (
            self._code[-1]
            if len(self._code) > max(start, self._barrier)
            else (int(Op.JUMP), 0, 0, 0)
        )
        if last[1] == source >= TEMPORARIES and last[0] < Op.JUMP:
            self._code[-1] = (last[0], destination, last[2], last[3])
        else:
            self._code.append((int(Op.MOVE), destination, source, _NONE))

    def label(self) -> int:
        """A new label without a position."""
        self._labels.append(-1)
        return len(self._labels) - 1

    def place(self, label: int) -> None:
        """Set the position of a label to here."""
        self._barrier = len(self._code)
        self._labels[label] = len(self._code)

    def jump(self, op: Op, label: int, a: Register = _NONE, b: Register = _NONE) -> None:
        """Write a jump, conditional or not."""
        self._code.append((int(op), label, a, b))

    def halt(self) -> None:
        """Write the end of a successful run."""
        self._code.append((int(Op.HALT), 0, 0, 0))

    def fail(self) -> None:
        """Write the end of a run whose guard does not hold."""
        self._code.append((int(Op.FAIL), 0, 0, 0))

    # ------------------------------------------------------------------------------------------ end

    def place_of(self, register: Register) -> int:
        """The index of a register in the register file of the finished program."""
        if register < CONSTANTS:
            return register
        if register < TEMPORARIES:
            return self._variables + register - CONSTANTS
        return self._variables + len(self._values) + register - TEMPORARIES

    def finish(self) -> tuple[NDArray[np.int32], Int64s]:
        """The program (int32[n, 4]) and its register file (int64[registers]) with the constants
        set.
        """
        code = np.array(self._code, np.int64).reshape(-1, 4)
        jumps = code[:, 0] >= Op.JUMP
        asks = code[:, 0] == Op.ASK
        assert (code[asks, 2] < CONSTANTS).all()  # numbers of decisions are no registers
        registers = code[:, 1:]
        np.maximum(registers, 0, out=registers)
        temporaries = registers >= TEMPORARIES
        registers += np.where(
            temporaries,
            self._variables + len(self._values) - TEMPORARIES,
            np.where(registers >= CONSTANTS, self._variables - CONSTANTS, 0),
        )
        if jumps.any():
            code[jumps, 1] = np.array(self._labels, np.int64)[code[jumps, 1]]
        slots = np.zeros(self._variables + len(self._values) + self._most_temporaries, np.int64)
        slots[self._variables : self._variables + len(self._values)] = self._values
        return np.ascontiguousarray(code, np.int32), slots
