"""`python -m symcheck` is the command line."""

from __future__ import annotations

import sys

from symcheck.cli import main

sys.exit(main())
