"""`symcheck workbench [MODEL [PROPERTIES]]`: serve the workbench until Ctrl-C."""

from __future__ import annotations

import argparse
import os
import signal
import socket
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from threading import Timer
from zlib import crc32

from symcheck.errors import UsageError
from symcheck.tables import optional_package

__all__ = ["serve"]

_FIRST_PORT = 49152
"""The first port that is free for everybody (IANA)."""
_ABOUT = "Opens models and properties in the browser: editor, checks, experiments, simulator."


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> None:  # type: ignore[override]
        raise UsageError(message, hint="symcheck workbench --help")


def _bind(listener: socket.socket, port: int, folder: Path) -> None:
    """Bind to a port: that of the folder, if none is given and it is free. A browser keeps unsaved
    texts for an address, and shows them again when the workbench of the folder is started again.

    Raises OSError, OverflowError.
    """
    if os.name == "posix":  # elsewhere it would take a port that is in use
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    if port == 0:
        of_folder = _FIRST_PORT + crc32(str(folder).encode()) % (2**16 - _FIRST_PORT)
        with suppress(OSError):
            listener.bind(("127.0.0.1", of_folder))
            return
    listener.bind(("127.0.0.1", port))


def serve(words: Sequence[str]) -> int:
    """Serve the workbench. words: those after `workbench`.

    Raises:
        UsageError: a word is wrong, a file is no model or properties, or the port is taken.
        UnsupportedError: the extra `workbench` is not installed.
    """
    parser = _Parser("symcheck workbench", description=_ABOUT)
    parser.add_argument("model", nargs="?", metavar="MODEL", help="model file")
    parser.add_argument("properties", nargs="?", metavar="PROPERTIES", help="properties file")
    parser.add_argument("--port", type=int, default=0, help="default: the same one for a folder")
    parser.add_argument("--no-browser", action="store_true", help="print the address only")
    arguments = parser.parse_args(words)
    uvicorn = optional_package("uvicorn", "workbench")
    optional_package("starlette", "workbench")
    from symcheck.workbench.app import Access, make_app
    from symcheck.workbench.project import Project

    given = {n: Path(p) for n in ("model", "properties") if (p := getattr(arguments, n))}
    folders = {path.resolve().parent for path in given.values()} or {Path.cwd()}
    if len(folders) > 1:
        raise UsageError("the model and its properties have to stand in one folder")
    project = Project(folders.pop(), [path.name for path in given.values()])
    for path in given.values():
        if path.suffix.lower() == ".jani":
            raise UsageError(f"{path}: the workbench edits models in the PRISM language, not JANI")
        project.read(path.name)
    with socket.socket() as listener:
        try:
            _bind(listener, arguments.port, project.folder)
            listener.listen(64)  # a browser that comes early waits
        except (OSError, OverflowError) as error:
            raise UsageError(f"--port: cannot use {arguments.port}: {error}") from None
        access = Access(f"127.0.0.1:{listener.getsockname()[1]}")
        app = make_app(project, access, {n: path.name for n, path in given.items()})
        config = uvicorn.Config(
            app,
            log_level="error",
            ws="none",
            timeout_graceful_shutdown=3,
            server_header=False,
        )
        print(f"The workbench is at http://{access.host}/?token={access.token}", flush=True)
        print("Ctrl-C ends it.", flush=True)
        if not arguments.no_browser:
            import webbrowser

            address = f"http://{access.host}/?token={access.once}"
            Timer(0.5, webbrowser.open, (address,)).start()
        server = uvicorn.Server(config)
        app.state.is_ending = lambda: server.should_exit

        def end(*_: object) -> None:
            server.should_exit = True

        for number in (signal.SIGINT, signal.SIGTERM):  # raised again by uvicorn at its end
            signal.signal(number, end)
        server.run(sockets=[listener])
    return 0
