"""`symcheck compare`: the answers of a peer beside those of symcheck."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from symcheck.cli.instance import InstancesTask
from symcheck.cli.run_state import RunState
from symcheck.peers.compare import Comparison, compared
from symcheck.peers.programs import Peer

__all__ = ["compare_answers"]


def compare_answers(
    state: RunState, task: InstancesTask, constants: Sequence[dict[str, str]], peer: Peer
) -> None:
    """Check the properties with symcheck and with a peer, and print a table.

    Answers that differ count as failures. Raises SymcheckError: the model is faulty.
    """
    models = (replace(task.model, given_constants=choice) for choice in constants)
    rows = tuple(
        row
        for model in models
        for row in compared(
            model, model.instances(task.file, task.of_properties, task.indices), peer
        )
    )
    comparison = Comparison(rows, peer.name)
    state.output.line()
    state.output.line(str(comparison))
    state.failures += len(comparison.different)
