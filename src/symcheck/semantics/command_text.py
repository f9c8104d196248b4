"""The text of a command as it stands in the model."""

from __future__ import annotations

from symcheck.semantics.model import BoundCommand, BoundModel
from symcheck.syntax.declarations import RenamedModule
from symcheck.syntax.printer import pretty

__all__ = ["command_text"]


def command_text(model: BoundModel, command: BoundCommand) -> str:
    """The text of a command; that of a renamed module has the new names.

    An edge of a JANI model, which is an object { … }, is printed as a command. A step of time of a
    timed automaton has no command in the text, but an invariant.
    """
    name, text = model.modules[command.module].name, " ".join(command.span.text.split())
    if model.clocks is not None and command.action == model.clocks.time:
        return f"[{command.action}] time passes in {name}"
    renamed = any(isinstance(m, RenamedModule) and m.name == name for m in model.program.modules)
    if not renamed and not text.startswith("{"):
        return text.rstrip("; ")
    updates = []
    for update in command.updates:
        sets = [f"({model.variables[i].name}'={pretty(e)})" for i, e in update.assignments]
        weight = pretty(update.probability)
        if update.upper is not None:
            weight = f"[{weight},{pretty(update.upper)}]"
        updates.append(f"{weight} : {' & '.join(sets) or 'true'}")
    return f"[{command.action or ''}] {pretty(command.guard)} -> {' + '.join(updates)}"
