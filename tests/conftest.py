"""Settings of hypothesis, and of machines without CUDD, for all tests.

In CI the examples are always the same: a run judges the change, not its luck; elsewhere they vary. No example has a deadline: how
long one takes says more of what else the machine does.
"""

from __future__ import annotations

import os
from collections.abc import Generator

import pytest
from hypothesis import settings

from symcheck.dd.cudd_import import available
from symcheck.errors import UnsupportedError

settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None]:
    """Where there is no CUDD, a test of diagrams is skipped."""
    try:
        yield
    except UnsupportedError:
        if available():
            raise
        pytest.skip("needs decision diagrams")
