"""Type checkers and completion know every public name."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import symcheck

ROOT = Path(__file__).parents[2]
REVEALED = {
    'symcheck.load("x.pm")': "symcheck.api.model.Model",
    'symcheck.loads("", {"N": 1}, type="mdp", engine="sparse", epsilon=1e-3)': "symcheck.api.model.Model",
    'model.check("true")': "symcheck.check.result.Result",
    "model.states": "symcheck.engines.states.States",
    "model.states[0]": "symcheck.engines.states.State",
    "model.states[:2]": "list[symcheck.engines.states.State]",
    "model.states.mask.dtype": "numpy.dtype[numpy.bool[builtins.bool]]",
    'model.states[0]["x"]': "int",
    'model.where("x=1") & ~model.deadlocks': "symcheck.engines.states.States",
    'model.labels["end"]': "symcheck.engines.states.States",
    "model.constants": "Mapping[str, bool | int | float | Fraction]",
    "next(iter(model.transitions)).target": "symcheck.engines.states.State",
    'model.rewards["r"]': "symcheck.api.model.StructureRewards",
    "result.bounds": "tuple[int | float | Fraction, int | float | Fraction]",
    "result.values": "symcheck.engines.states.StateValues",
    "result.satisfying": "symcheck.engines.states.States",
    "result.front": "symcheck.check.pareto_front.ParetoFront",
    "model.type": "symcheck.syntax.ast.ModelType",
    "result.strategy[0]": "str",
    "dict(result.strategy)": "dict[symcheck.engines.states.State | tuple[",
    "result.accuracy": "Exact | Certified | Estimate | Statistical",
    "result.strategy": "symcheck.engines.explicit.strategy.Strategy",
    "model.steady_state()": "symcheck.check.state_distributions.Distribution",
    "model.steady_state()[0]": "float | fractions.Fraction",
    "list(model.check_all('x'))[0][1]": "symcheck.check.result.Result",
    "model.check_all('x')['six']": "symcheck.check.result.Result",
    "model.successors(x=1)[0].successors": "Mapping[symcheck.engines.states.State, float | Fraction]",
    "model.bsccs[0]": "symcheck.engines.states.States",
    "symcheck.view.results([])": "symcheck.tables.Table",
    "symcheck.teach.frontiers": "def (",
}
WRONG = ('symcheck.laod("x.pm")', 'symcheck.load("x.pm", engine="sprase")', 'model.chekc("true")')


def plain(text: str) -> str:
    """A type as mypy writes it, without the module of a standard name."""
    for prefix in (
        "typing.",
        "collections.abc.",
        "builtins.",
        "fractions.",
        "symcheck.check.result.",
    ):
        text = text.replace(prefix, "")
    return text


DELIBERATE = 'Argument "engine" to "load" has incompatible type "Literal[\'sprase\']"'
"""The only type error of the pages: an example of a misspelt option."""


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """What mypy says in one run, of a program and of the Python examples of each page.

    The tutorial is left out: it names frames of five types `frame`. The options of the package are
    those of the project, and so is the cache: its sources are not read again.
    """
    pytest.importorskip("mypy")
    folder = tmp_path_factory.mktemp("typed")
    program = ["import symcheck", 'model = symcheck.load("x.pm")', 'result = model.check("true")']
    program += [f"reveal_type({text})" for text in REVEALED] + list(WRONG)
    texts = {"program": program}
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        blocks = re.findall(
            r"^```python\n(.*?)^```", page.read_text("utf-8"), re.MULTILINE | re.DOTALL
        )
        lines = [text for block in blocks for text in block.splitlines()]
        code = [text[4:] for text in lines if text.startswith((">>> ", "... "))]
        if code and page.stem != "tutorial":
            texts[f"page_{page.stem}"] = code
    for name, code in texts.items():
        (folder / f"{name}.py").write_text("\n".join(code) + "\n", "utf-8")
    project = (ROOT / "pyproject.toml").read_text("utf-8")
    settings = folder / "pyproject.toml"
    pages = [name for name in texts if name != "program"]
    settings.write_text(
        f"{project}\n[[tool.mypy.overrides]]\nmodule = {pages}\n"
        "allow_redefinition = true\nignore_missing_imports = true\n"
        "disallow_untyped_calls = false\ndisallow_untyped_defs = false\n"
        'disable_error_code = ["exhaustive-match"]\n',
        "utf-8",
    )
    files = [str(folder / f"{name}.py") for name in texts]
    command = [sys.executable, "-m", "mypy", "--config-file", str(settings), *files]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    found: dict[str, list[str]] = {name: [] for name in texts}
    for line in done.stdout.splitlines():
        name = Path(line.partition(":")[0]).stem
        if name in found:  # a message of the cache names the directory of an earlier test
            found[name].append(line)
    return found


def test_mypy_knows_the_types(messages: dict[str, list[str]]) -> None:
    found = (re.match(r"[^:]*:(\d+): (.*)", line) for line in messages["program"])
    lines = {int(m[1]): m[2] for m in found if m}
    for number, (text, expected) in enumerate(REVEALED.items(), 4):
        assert plain(expected) in plain(lines[number]), text
    wrong = range(4 + len(REVEALED), 4 + len(REVEALED) + len(WRONG))
    assert all("error" in lines[n] for n in wrong), lines


def test_examples_of_the_pages_are_typed(messages: dict[str, list[str]]) -> None:
    """Who copies an example into a typed program has no errors."""
    pages = [name for name in messages if name != "program"]
    assert len(pages) > 8
    errors = [line for name in pages for line in messages[name] if " error: " in line]
    assert [e for e in errors if DELIBERATE not in e] == []
    assert len(errors) == 1  # mypy has read the pages


def test_names_for_type_checkers_are_those_at_run_time() -> None:
    tree = ast.parse(Path(symcheck.__file__).read_text(encoding="utf-8"))
    typed = {
        f"{node.module}:{alias.asname}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module.startswith("symcheck")
        for alias in node.names
    }
    home = {
        f"symcheck:{name}" if module == name else f"symcheck.{module}:{name}"
        for name, module in symcheck._HOME.items()
    }
    assert typed == home | {"symcheck.version:__version__"}


@pytest.mark.parametrize("name", symcheck.__all__)
def test_names_exist(name: str) -> None:
    assert getattr(symcheck, name) is not None
    assert name in dir(symcheck)


def test_completion_offers_public_names_of_a_model() -> None:
    model = symcheck.loads("dtmc module m x : [0..1]; endmodule")
    shown = {n for n in dir(model) if not n.startswith("_")}
    assert {"states", "transitions", "where", "check", "matrix", "labels", "rewards"} <= shown
    for name in shown - set(vars(model)):
        value = inspect.getattr_static(type(model), name)
        function = getattr(value, "fget", getattr(value, "func", getattr(value, "__func__", value)))
        assert inspect.getdoc(function), name
