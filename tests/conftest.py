"""In CI the examples that hypothesis tries are always the same: a run judges the change, not its luck. Elsewhere they vary."""

from __future__ import annotations

import os

from hypothesis import settings

settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")
