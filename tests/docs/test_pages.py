"""What the pages show is what comes out: commands, Python, switches, links, and the index of pages."""

from __future__ import annotations

import doctest
import re
import runpy
import shlex
import tomllib
from pathlib import Path

import pytest

from symcheck.api.loading import load
from symcheck.cli import main
from symcheck.cli.switches import prism_options
from symcheck.cli.switches.arguments import make_parser

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(p.name for p in DOCS.glob("*.md"))


def blocks(page: str, language: str) -> list[str]:
    """The code blocks of a language, with the indentation of a list taken away."""
    text = (DOCS / page).read_text()
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```", text, re.DOTALL | re.MULTILINE)
    return [
        "".join(line[len(indent) :] + "\n" for line in body.splitlines()) for indent, body in found
    ]


COMMANDS = [(page, block) for page in (*PAGES, "../README.md") for block in blocks(page, "console")]


@pytest.mark.parametrize(
    ("page", "block"), COMMANDS, ids=[f"{p}-{i}" for i, (p, _) in enumerate(COMMANDS)]
)
def test_commands_print_what_the_page_says(
    page: str,
    block: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A block without output shows none; others show all of it but what "…" stands for."""
    (tmp_path / "models").symlink_to(ROOT / "models")
    monkeypatch.chdir(tmp_path)
    command, *shown = block.splitlines()
    assert command.startswith("$ symcheck ")
    main(shlex.split(command)[2:])
    printed = capsys.readouterr()
    if shown:
        assert re.fullmatch(
            output_pattern(shown), text_of((printed.out + printed.err).splitlines())
        )


def output_pattern(shown: list[str]) -> str:
    """What is printed if a block shows these lines.

    A line "…" stands for one or more lines, "…" at an end of a line for a part of it, and each
    other line for itself. Empty lines are not compared.
    """
    return "".join(
        r"(?:.*\n)+"
        if line.strip() == "…"
        else ".+" * line.startswith("…")
        + re.escape(line.removeprefix("…").removesuffix("…"))
        + ".+" * line.endswith("…")
        + r"\n"
        for line in filter(str.strip, shown)
    )


def text_of(lines: list[str]) -> str:
    return "".join(f"{line}\n" for line in lines if line.strip())


@pytest.mark.parametrize(
    ("shown", "said"),
    [
        (["a", "b", "c"], True),
        (["…", "c"], True),
        (["a", "", "…"], True),
        (["a", "…", "c"], True),
        (["b", "c"], False),
        (["a", "b"], False),
        (["a", "c"], False),
        (["…", "a", "b", "c"], False),
        (["a", "…", "b", "c"], False),
        (["a", "b", "c", "…"], False),
        (["…", "b…"], False),
    ],
)
def test_left_out_lines_have_an_ellipsis_and_no_others(shown: list[str], said: bool) -> None:
    assert bool(re.fullmatch(output_pattern(shown), text_of(["a", "", "b", "c"]))) == said


@pytest.mark.parametrize(
    ("shown", "said"),
    [("x=0.25", True), ("x=0.2…", True), ("…0.25", True), ("x=0.2", False), ("x=0.25…", False)],
)
def test_left_out_parts_of_lines_have_an_ellipsis(shown: str, said: bool) -> None:
    assert bool(re.fullmatch(output_pattern([shown]), text_of(["x=0.25"]))) == said


@pytest.mark.parametrize(
    "page",
    [p for p in (*PAGES, "../README.md") if p != "tutorial.md" and blocks(p, "python")],
)
def test_python_prints_what_the_page_says(page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    test = doctest.DocTestParser().get_doctest("\n".join(blocks(page, "python")), {}, page, page, 0)
    said: list[str] = []
    assert doctest.DocTestRunner(verbose=False).run(test, out=said.append).failed == 0, "".join(
        said
    )


@pytest.mark.parametrize("block", blocks("modelling.md", "prism"))
def test_models_of_the_chapter_on_modelling_are_files(block: str) -> None:
    """A block begins with the name of its file, which holds the lines of the block in this order."""
    name, *shown = block.splitlines()
    lines = iter((ROOT / name.removeprefix("// ")).read_text().splitlines())
    for line in filter(str.strip, shown):
        assert line in lines, line


@pytest.mark.parametrize("page", [*PAGES, "../README.md", "../CONTRIBUTING.md"])
def test_installations_name_existing_extras(page: str) -> None:
    known = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    named = re.findall(r"'(?:symcheck|\.)\[([^]]*)\]'", (DOCS / page).read_text())
    assert {extra for extras in named for extra in extras.split(",")} <= set(known)


@pytest.mark.parametrize("page", ["../README.md", "getting_started.md"])
def test_all_extras_of_users_are_explained(page: str) -> None:
    known = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (whole,) = known["all"]
    extras = set(known) - {"all", "test", "check", "docs"}
    assert set(re.fullmatch(r"symcheck\[(.*)\]", whole)[1].split(",")) == extras
    text = (DOCS / page).read_text()
    assert ".[all]'" in text
    assert all(re.search(rf"\b{extra}\b", text) for extra in extras)


def test_every_switch_is_explained() -> None:
    """And no other: what the page names exists."""
    text = (DOCS / "command_line.md").read_text()
    named = {
        switch
        for cell in re.findall(r"`([^`]*)`", text)
        for switch in re.findall(r"(?:^|\s)-([a-z?][\w]*)", cell)
    }
    own = {s.lstrip("-") for action in make_parser()._actions for s in action.option_strings}
    foreign = {
        *prism_options._WITHOUT_EFFECT,
        *prism_options._REFUSED,
        "exportadv",
        "exportadvmdp",
        "dir",
    }
    assert named == own | foreign


def test_the_table_of_options_is_as_they_are_declared() -> None:
    """Otherwise run docs/make_options.py."""
    made = runpy.run_path(str(DOCS / "make_options.py"))
    page = (DOCS / "command_line.md").read_text()
    assert made["TABLE"].findall(page) == [made["table"]()]
    assert (DOCS / "symcheck.1").read_text() == made["manual"]()


@pytest.mark.parametrize(
    "page",
    [
        *PAGES,
        "../README.md",
        "../CONTRIBUTING.md",
        "../models/README.md",
    ],
)
def test_links_lead_somewhere(page: str) -> None:
    text = (DOCS / page).read_text()
    for target, anchor in re.findall(r"\]\(([^)#]*)(?:#([^)]*))?\)", text):
        if "://" in target:
            continue
        path = (DOCS / page).parent / target if target else DOCS / page
        assert path.exists(), target
        if anchor:
            heads = re.findall(r"^#+ (.*)$", path.read_text(), re.MULTILINE)
            assert anchor in {
                re.sub(r"[^\w -]", "", h).strip().lower().replace(" ", "-") for h in heads
            }, anchor


def test_the_index_names_every_page() -> None:
    text = (DOCS / "README.md").read_text()
    assert set(re.findall(r"\]\((\w+\.md)\)", text)) == set(PAGES) - {"README.md"}


def test_the_models_are_as_their_index_says() -> None:
    text = (ROOT / "models" / "README.md").read_text()
    rows = re.findall(
        r"^\| `(\S+)` \| (\w+) \|([^|]*)\| ([\d ]+|infinitely many) \|", text, re.MULTILINE
    )
    found = {
        p.relative_to(ROOT / "models").as_posix()
        for p in (ROOT / "models").glob("*/*")
        if p.suffix in (".pm", ".sm", ".nm", ".ma", ".prism", ".jani")
    }
    assert {name for name, *_ in rows} == found
    for name, kind, constants, states in rows:
        if "see" in constants:
            continue
        given = dict(c.split("=") for c in constants.strip("` ").split(",") if c)
        model = load(ROOT / "models" / name, given)
        if states == "infinitely many":
            assert model.growth is not None
            continue
        assert (model.type.name, model.engine.states) == (
            kind,
            int(states.replace(" ", "")),
        ), name


def test_paths_in_contributing_exist() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text()
    paths = re.findall(r"`((?:[\w.]+/)+(?:\w+\.\w+)?|\w+\.(?:py|md))`", text)
    assert len(paths) > 20
    for path in paths:
        found = [(base / path).exists() for base in (ROOT, ROOT / "src" / "symcheck")]
        assert any(found) or path == "tuning.py", path


PROSE = [*sorted(DOCS.glob("*.md")), ROOT / "models" / "README.md", *sorted(ROOT.glob("*.md"))]


@pytest.mark.parametrize("page", PROSE, ids=[str(page.relative_to(ROOT)) for page in PROSE])
def test_prose_has_lines_of_at_most_100_characters(page: Path) -> None:
    """Code, what commands print, tables and definitions of links are as wide as they are."""
    prose = re.sub(r"^( *```).*?^\1", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    lines = [line for line in prose.splitlines() if not re.match(r" *(\||\[[^]]+\]:)", line)]
    assert [line for line in lines if len(line) > 100] == []


@pytest.mark.parametrize("page", PAGES)
def test_lists_tables_and_code_stand_between_blank_lines(page: str) -> None:
    """Python-Markdown, which makes the site, takes them for text of the paragraph otherwise."""
    before, inside, found = "", False, []
    for number, line in enumerate((DOCS / page).read_text().splitlines(), 1):
        is_fence = line.startswith("```")
        begins = is_fence or (not inside and re.match(r"- |\d+\. |\|", line) is not None)
        goes_on = inside or re.match(r"- |\d+\. |\||#| |$", before) is not None
        ended = before == "```" and not inside and not line.startswith("#")
        if (begins and not goes_on and before) or (ended and line):
            found.append(f"{page}:{number}: {line}")
        inside, before = inside != is_fence, line
    assert found == []


def test_the_site_has_every_page() -> None:
    named = re.findall(
        r"^ +- ([a-z_]+\.md|README\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE
    )
    assert sorted(named) == PAGES
