"""Checks of the declarations of players."""

from __future__ import annotations

from symcheck.semantics.binding.static_checks import CheckedProgram
from symcheck.semantics.diagnostics import suggest
from symcheck.syntax.ast import ModelType

__all__ = ["check_players"]


def check_players(checked: CheckedProgram, kind: ModelType) -> None:
    """Report faulty declarations of players to the report of the program."""
    program, report = checked.program, checked.table.report
    if kind.players < 2:
        for player in program.players:
            message = f"players belong to games, and these are {kind.called}"
            report.input("players", message, player.span, "the first word of a game is smg")
        return
    if kind.concurrent:
        _check_concurrent(checked)
    if not program.players:
        message = "a game needs players"
        report.input("players", message, program.span, "player p1 module1, [action] endplayer")
    modules = {m.name for m in program.modules}
    actions = {
        scope.renamed(action)
        for instance, scope in checked.modules
        for c in instance.base_module.commands
        for action in (c.action, *c.others)
        if action is not None
    }
    names: set[str] = set()
    for what, known, owned in (
        ("module", modules, [(m, p) for p in program.players for m in p.modules]),
        ("action", actions, [(a, p) for p in program.players for a in p.actions]),
    ):
        seen: set[str] = set()
        for name, player in owned:
            if name not in known:
                hint = suggest(name, known)
                report.name(f"unknown-{what}", f"unknown {what} {name}", player.span, hint)
            elif name in seen:
                message = f"{what} {name} belongs to two players"
                report.input("players", message, player.span)
            seen.add(name)
    for player in program.players:
        if player.name in names:
            report.name("players", f"a second player {player.name}", player.span)
        names.add(player.name)


def _check_concurrent(checked: CheckedProgram) -> None:
    """Report what modules cannot do that all take part in each joint action."""
    program, report = checked.program, checked.table.report
    for player in program.players:
        own = {
            scope.renamed(c.action)
            for instance, scope in checked.modules
            for c in instance.base_module.commands
            if instance.name in player.modules and c.action is not None
        }
        for action in (a for a in player.actions if a not in own):
            message = f"no module of player {player.name} has commands of action {action}"
            hint = "what a player can pick are the first actions of commands in its modules"
            report.input("players", message, player.span, hint)
    if program.system is not None:
        message = "the modules of a concurrent game are composed by its joint actions"
        report.input(
            "players", message, program.system.span, "joint actions need no system … endsystem"
        )
    for variable in program.globals:
        message = "a concurrent game has no global variables, because several modules act at once"
        hint = "declare it in the module that writes it; all modules can read it"
        report.input("global-write", message, variable.span, hint)
