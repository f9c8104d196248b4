"""The figures of the tutorial: `python docs/make_figures.py [FOLDER]`, docs/figures by default.

It needs the extras `plot` and `view`.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

from matplotlib import pyplot

import symcheck
from symcheck import Options, teach, view
from symcheck.symbolic.build import construct
from symcheck.syntax.parse import parse_expression

ROOT = Path(__file__).resolve().parent.parent
PAIRS = """dtmc
module three_coins_told_twice
  i : [0..3] init 0;
  a1 : bool init false;  a2 : bool init false;  a3 : bool init false;
  b1 : bool init false;  b2 : bool init false;  b3 : bool init false;

  [] i=0 -> 0.5 : (a1'=true) & (b1'=true) & (i'=1) + 0.5 : (i'=1);
  [] i=1 -> 0.5 : (a2'=true) & (b2'=true) & (i'=2) + 0.5 : (i'=2);
  [] i=2 -> 0.5 : (a3'=true) & (b3'=true) & (i'=3) + 0.5 : (i'=3);
  [] i=3 -> true;
endmodule
"""


def bound(name: str) -> symcheck.BoundModel:
    """A model of the repository."""
    return symcheck.bind(symcheck.parse_model_file(ROOT / "models" / name))


def die_states() -> Any:
    """The die as a state graph."""
    die = symcheck.load(ROOT / "models" / "die" / "die.pm")
    picture = view.state_graph(
        die,
        values=die.check("P=? [ F d=6 ]"),
        sets={"six": "d=6"},
        title="the die, with probabilities of a six",
    )
    return picture.draw()


def die_diagrams() -> Any:
    """Reachable states and matrix of the die as diagrams."""
    made = construct(bound("die/die.pm"), Options())
    encoding = made.space.symbolic.encoding
    assert made.matrix is not None
    pictures = (
        view.picture(made.space.states, encoding, title="reachable states"),
        view.picture(made.matrix, encoding, title="matrix"),
    )
    _, axes = pyplot.subplots(1, 2, figsize=(12, 4.2), layout="constrained", width_ratios=(1, 2))
    for picture, part in zip(pictures, axes, strict=True):
        picture.draw(part)
    return axes[0]


def search() -> Any:
    """Nodes and states while the philosophers are explored."""
    symbolic = symcheck.build(bound("dining/dining.nm"), Options())
    frames = list(teach.frontiers(symbolic))
    return view.plot_search(
        (f.iteration for f in frames), title="three philosophers, breadth first"
    )


def bounds() -> Any:
    """Interval iteration on a fair game of the gambler."""
    engine = symcheck.load(ROOT / "models" / "gambler" / "gambler.pm").engine
    seen = teach.until_trace(
        engine, engine.all, engine.where(parse_expression("money=20")), Options(method="interval")
    )
    axes = view.plot_bounds(
        seen.steps[:600], state=4, truth=0.25, title="the gambler wins 20, starting with 5"
    )
    axes.set(xlim=(0, 600), ylabel="probability of winning")
    return axes


def blocks() -> Any:
    """The matrix of Herman's ring as blocks."""
    seen = teach.block_structure(construct(bound("herman/herman7.pm"), Options()), budget=1)
    counts = f"{len(seen.blocks)} distinct blocks, {len(seen.occurrences)} occurrences"
    title = f"Herman's ring of 7: {counts}"
    return view.plot_blocks(seen, title=title)


def orders() -> Any:
    """The same model under orders that keep what belongs together near each other, or not."""
    model = symcheck.bind(symcheck.parse_model(PAIRS))
    pairs = ("a1", "b1", "a2", "b2", "a3", "b3")
    apart = ("a1", "a2", "a3", "b1", "b2", "b3")
    tried = [
        ("i", *pairs),
        (*pairs, "i"),
        ("i", *apart),
        (*apart, "i"),
        ("a1", "b1", "a2", "b2", "i", "a3", "b3"),
    ]
    return view.plot_orders(
        list(teach.compare_orders(model, Options(), tried)), title="one model, five orders"
    )


def parameters() -> Any:
    """A function of two parameters, and the regions of a threshold."""
    zeroconf = symcheck.load(ROOT / "models" / "parameters" / "zeroconf.pm").parametric("p,q")
    _, axes = pyplot.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    function = zeroconf.check('P=? [ F "wrong" ]').function
    view.plot_function(function, zeroconf.parameters, axes[0])
    regions = zeroconf.check('P<=0.1 [ F "wrong" ]').regions
    return view.plot_regions(regions, axes[1])


def page(folder: Path) -> None:
    """A page at an iteration of the interval method, as a browser shows it."""
    chromium = shutil.which("chromium")
    if chromium is None:
        print("Chromium is not installed: page.png stays as it is.")
        return
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / "die.html"
        made = symcheck.load(ROOT / "models" / "die" / "die.pm").page(
            ["P=? [ F d=6 ]", 'R{"tosses"}=? [ F "done" ]']
        )
        made.save(file)
        groups: dict[str, list[str]] = {}
        for i, show in enumerate(made.data["shows"]):
            groups.setdefault(show.get("group") or str(i), []).append(show["name"])
        number = 1 + [name for names in groups.values() for name in names].index(
            "Interval iteration"
        )
        switches = (
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            "--window-size=1250,720",
        )
        profile, target = f"--user-data-dir={place}/profile", f"--screenshot={folder / 'page.png'}"
        subprocess.run(
            [chromium, *switches, profile, target, f"{file.as_uri()}#{number}.6"],
            check=True,
            capture_output=True,
        )


FIGURES = {
    f.__name__: f for f in (die_states, die_diagrams, search, bounds, blocks, orders, parameters)
}


def main(folder: Path) -> None:
    """Write every figure into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in FIGURES.items():
        figure = make().figure
        figure.savefig(folder / f"{name}.png", dpi=100, metadata={"Software": None})
        pyplot.close(figure)
    page(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "figures")
