"""Settings of hypothesis, for all tests.

In CI the examples are always the same: a run judges the change, not its luck; elsewhere they vary. No example has a deadline: how
long one takes says more of what else the machine does.
"""

from __future__ import annotations

import os

from hypothesis import settings

settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")
