"""How jupyterlab-lsp finds the language server."""

from __future__ import annotations

import sys
from typing import Any

__all__ = ["specification"]


def specification(_: object) -> dict[str, dict[str, Any]]:
    """The entry `jupyter_lsp_spec_v1`: the command of the server, and its languages.

    Its argument is the manager of the servers, which is not asked.

    Source: jupyterlab-lsp, "Specs: extending jupyterlab-lsp".
    """
    return {
        "symcheck-lsp": {
            "version": 2,
            "argv": [sys.executable, "-c", "from symcheck.lsp.server import main; main()"],
            "languages": ["prism", "prism-properties"],
            "mime_types": ["text/x-prism", "text/x-prism-properties"],
            "display_name": "symcheck-lsp",
        }
    }
