"""Settings of hypothesis, of machines without CUDD, and of Ctrl-C, for all tests.

In CI the examples are always the same: a run judges the change, not its luck; elsewhere they vary.
No example has a deadline: how long one takes says more of what else the machine does.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Generator

import pytest
from hypothesis import settings

from symcheck.dd.cudd_import import available
from symcheck.errors import UnsupportedError

settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")

# Processes in the background of a shell ignore Ctrl-C, and the ones that tests start would, too.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None]:
    """Where there is no CUDD, a test of diagrams is skipped."""
    try:
        yield
    except UnsupportedError:
        if available():
            raise
        pytest.skip("needs decision diagrams")
