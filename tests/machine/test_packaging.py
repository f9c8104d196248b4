"""What an installation asks for, and what the release workflow builds and tests."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
WHEELS = PROJECT["tool"]["cibuildwheel"]


@pytest.mark.parametrize(
    ("system", "machine", "python", "expected"),
    [
        ("linux", "x86_64", "3.11", "==0.6.0"),
        ("linux", "x86_64", "3.13", "==0.6.0"),
        ("linux", "x86_64", "3.14", "<0.7,>=0.6"),
        ("linux", "aarch64", "3.12", "<0.7,>=0.6"),
        ("darwin", "arm64", "3.13", "<0.7,>=0.6"),
        ("darwin", "x86_64", "3.11", "<0.7,>=0.6"),
        ("win32", "AMD64", "3.12", "<0.7,>=0.6"),
    ],
)
def test_dd_has_one_version_where_its_wheels_have_cudd(
    system: str, machine: str, python: str, expected: str
) -> None:
    here = {"sys_platform": system, "platform_machine": machine, "python_version": python}
    requirements = map(Requirement, PROJECT["project"]["dependencies"])
    chosen = [
        str(r.specifier)
        for r in requirements
        if r.name == "dd" and r.marker is not None and r.marker.evaluate(here)
    ]
    assert chosen == [expected]


def test_wheels_are_built_for_the_versions_of_python_that_the_package_names() -> None:
    named = re.findall(r":: (3\.\d+)", "\n".join(PROJECT["project"]["classifiers"]))
    assert WHEELS["build"].split() == [f"cp{version.replace('.', '')}-*" for version in named]


def test_the_tests_of_a_wheel_exist() -> None:
    words = WHEELS["test-command"].split()
    files = [word for word in words if "/" in word]
    assert len(files) > 5
    for file in files:
        assert (ROOT / file).exists(), file
        assert file.split("/")[0] in WHEELS["test-sources"]
