"""A widget that walks through a model and draws where it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from anywidget import AnyWidget
from traitlets import Dict

from symcheck.api.model import Model
from symcheck.errors import ResourceError, SymcheckError, UnsupportedError, UsageError
from symcheck.simulate.snapshot import snapshot
from symcheck.view.diagrams import picture
from symcheck.view.picture import Picture
from symcheck.view.states import neighbourhood

__all__ = ["Explorer"]

_HERE = Path(__file__).parent
_MOST_STEPS = 1000
"""Steps of a path that are taken at once."""
_SHOWN_ROWS = 200
"""The last rows of a path, which are shown."""
_PATIENCE = 2.0
"""Seconds that the states of a model may take; longer ones are walked through without a picture."""


class Explorer(AnyWidget):  # type: ignore[misc]
    """A simulator with pictures, alive in a notebook.

    Each transition of the current state is a button. Beside the path stands a picture: the states
    around the current one, the diagram of the reachable states, or that of the matrix. The path is
    in `simulator`, and cells may read it and move it (`refresh` shows what they did).

    Args:
        model: the model. It is built only for pictures.
        seed: of the random numbers; None draws one.

    Attributes:
        simulator: the path.
        picture: the picture that is drawn: a name in `PICTURES`.

    Examples:
        >>> import symcheck
        >>> from symcheck.notebook import Explorer  # doctest: +SKIP
        >>> Explorer(symcheck.load("models/die/die.pm"), seed=1)  # doctest: +SKIP
    """

    PICTURES = ("states around", "reachable states", "matrix", "none")

    _esm = _HERE / "explorer.js"
    _css = _HERE / "explorer.css"
    shown = Dict().tag(sync=True)

    def __init__(self, model: Model, seed: int | None = None) -> None:
        super().__init__()
        self.simulator = model.simulator(seed)
        self.picture = self.PICTURES[0]
        self._model = model
        self._explicit = model.with_options(engine="explicit", time_limit=_PATIENCE)
        self._refusal = ""
        self._drawn: dict[str, str] = {}
        self.on_msg(lambda _, message, __: self.receive(message))
        self.refresh()

    def refresh(self, error: str = "") -> None:
        """Show the path as it is now, with what went wrong."""
        known = max(0, len(self.simulator.path.steps) - _SHOWN_ROWS)
        path = snapshot(self.simulator, known)
        svg, note = self._picture(path["state"])
        self.shown = {
            "path": path,
            "first": known,
            "continuous": self._model.type.continuous_time,
            "pictures": list(self.PICTURES),
            "picture": self.picture,
            "svg": svg,
            "note": note,
            "error": error,
        }

    def receive(self, message: dict[str, Any]) -> None:
        """Do what a button asks for: `do` is 'step', 'run', 'back', 'restart' or 'draw'."""
        error = ""
        try:
            match message.get("do"):
                case "step":
                    self.simulator.step(message.get("choice"), message.get("branch"))
                case "run":
                    self.simulator.run(min(int(message["steps"]), _MOST_STEPS))
                case "back":
                    if len(self.simulator.path.steps) > 1:
                        self.simulator.back()
                case "restart":
                    self.simulator.restart()
                case "draw" if message.get("picture") in self.PICTURES:
                    self.picture = str(message["picture"])
                case _:
                    raise UsageError(f"there is no such move: {message}")
        except SymcheckError as fault:
            error = str(fault)
        self.refresh(error)

    def _picture(self, here: str) -> tuple[str, str]:
        """The picture as SVG, and a line below it; `here` is the current state as a formula."""
        if self.picture == "none":
            return "", ""
        try:
            if self.picture == "states around":
                if self._refusal:
                    return "", self._refusal
                drawn, radius = neighbourhood(self._explicit, here)
                note = f"The current state is green; the others are at most {radius} steps from it."
                return drawn.svg, note
            if self.picture not in self._drawn:
                self._drawn[self.picture] = self._diagram().svg
            return self._drawn[self.picture], ""
        except ResourceError as error:
            self._refusal = f"the states are not drawn: {error}"  # it is not tried at each step
            return "", self._refusal
        except SymcheckError as error:  # too large, or the model is faulty
            return "", str(error)

    def _diagram(self) -> Picture:
        if self._model.options.exact:
            raise UnsupportedError("diagrams of rational models are not drawn")
        if self.picture == "reachable states":
            return picture(self._model, part="states", title=self.picture)
        return picture(self._model, part="matrix", title=self.picture)
