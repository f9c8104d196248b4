"""Python in a process of its own in which dd has no CUDD, as on most platforms."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

MODELS = Path(__file__).resolve().parents[1] / "models"
HIDE_CUDD = """
import sys
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name == "dd.cudd":
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Hidden())
"""
IMPORTS = """
import symcheck
from symcheck import teach, view
"""


def run(code: str, **variables: str) -> list[str]:
    """The lines that Python prints where dd has no CUDD, with variables of the environment."""
    environment = {k: v for k, v in os.environ.items() if k != "SYMCHECK_CUDD"} | variables
    done = subprocess.run(
        [sys.executable, "-c", HIDE_CUDD + IMPORTS + code],
        capture_output=True,
        text=True,
        cwd=MODELS,
        env=environment,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()
