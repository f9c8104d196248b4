"""`symcheck compare`: the answers of a peer beside those of symcheck."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from symcheck.cli.instance import InstancesTask
from symcheck.cli.run_state import RunState
from symcheck.peers.compare import ComparedProperty, Comparison, compared
from symcheck.peers.programs import Peer

__all__ = ["compare_answers"]


def compare_answers(
    state: RunState, task: InstancesTask, constants: Sequence[dict[str, str]], peer: Peer
) -> None:
    """Check the properties with symcheck and with a peer, and print a table.

    The table has the rows that are complete when a limit or the user stops the run. Answers that
    differ count as failures, and so does a table without two answers to compare.

    Raises SymcheckError: the model is faulty, or the run was stopped.
    """
    rows: list[ComparedProperty] = []
    try:
        for choice in constants:
            model = replace(task.model, given_constants=choice)
            instances = model.instances(task.file, task.of_properties, task.indices)
            rows += compared(model, instances, peer)
    finally:
        comparison = Comparison(tuple(rows), peer.name)
        if rows:
            state.output.line()
            state.output.line(str(comparison))
    state.failures += len(comparison.different)
    if rows and not comparison.answered:
        state.output.warn("there are no two answers to compare")
        state.failures += 1
