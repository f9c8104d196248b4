"""The answers to the browser: for one browser at a time, from this machine, with the token."""

from __future__ import annotations

import asyncio
import json
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import aclosing, asynccontextmanager
from importlib.resources import files
from itertools import count
from secrets import compare_digest, token_urlsafe
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.responses import StreamingResponse as Stream
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from symcheck.errors import SymcheckError, UsageError
from symcheck.lsp.answers import MODELS
from symcheck.version import __version__
from symcheck.workbench.language import Texts, analysis, completions, formatted, hover
from symcheck.workbench.option_fields import option_fields
from symcheck.workbench.processes import Worker
from symcheck.workbench.project import PROPERTIES, NewerFileError, Project

__all__ = ["Access", "make_app"]

WORKERS = ("check", "draw", "simulate", "explore")
"""The processes; each does one job at a time."""

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; connect-src 'self'; "
    "img-src 'self' data: blob:; frame-src 'self'; form-action 'none'; base-uri 'none'; "
    "frame-ancestors 'none'"
)
_PAGE_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data:; frame-ancestors 'self'"
)
"""A drawn page has its script within it; it has no origin, and reaches nothing."""
_HEADERS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
_LARGEST = 20_000_000
"""Bytes of a question."""
_PAGES = 8
"""Drawn pages that are kept."""


class Access:
    """Who may ask: a browser that knows a token of the address, which becomes a cookie.

    Attributes:
        host: the Host header that is answered, such as 127.0.0.1:8000.
        token: that of the address which the terminal shows.
        once: another one, for a single use: an address on the command line of a browser is seen by
            other users of the machine.
    """

    def __init__(self, host: str) -> None:
        self.host, self.token, self.once = host, token_urlsafe(32), token_urlsafe(32)
        self._secret, self._used = token_urlsafe(32), False
        self.cookie = f"symcheck-{host.rpartition(':')[2]}"  # cookies do not tell ports apart

    def exchanges(self, token: str) -> bool:
        """Whether a token is valid. The one for a single use is so only now."""
        if not self._used and compare_digest(token.encode(), self.once.encode()):
            self._used = True
            return True
        return compare_digest(token.encode(), self.token.encode())

    def refusal(self, request: Request) -> str:
        """Why a request is not answered; "" if it is."""
        if request.headers.get("host") != self.host:
            return "this host name is not that of the workbench"
        if request.method != "GET" and request.headers.get("origin") != f"http://{self.host}":
            return "the request comes from another page"
        given = request.cookies.get(self.cookie, "")
        if not compare_digest(given.encode(), self._secret.encode()):
            return "open the address that symcheck workbench has printed"
        return ""

    def admitted(self) -> Response:
        """The answer to the address with a token."""
        response = RedirectResponse("/", 303)
        response.set_cookie(self.cookie, self._secret, httponly=True, samesite="strict")
        return response


class _Guard:
    """Answers nothing to requests without access, and sets the headers of all answers."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self.app, self.access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        request = Request(scope, receive)
        refusal = self.access.refusal(request)
        app = self.app
        if refusal:
            token = request.query_params.get("token", "")
            enters = request.method == "GET" and scope["path"] == "/"
            of_host = request.headers.get("host") == self.access.host
            admitted = enters and of_host and self.access.exchanges(token)
            app = self.access.admitted() if admitted else PlainTextResponse(refusal, 403)

        async def sending(message: Any) -> None:
            if message["type"] == "http.response.start":
                known = Headers(raw=message["headers"])
                more = {"Content-Security-Policy": _POLICY, **_HEADERS}
                message["headers"] += [
                    (n.lower().encode(), v.encode()) for n, v in more.items() if n not in known
                ]
            await send(message)

        await app(scope, receive, sending)


def make_app(project: Project, access: Access, start: Mapping[str, str]) -> Starlette:
    """The application.

    Args:
        project: its files.
        access: who may use it.
        start: the names of the model and the properties that are shown first.
    """
    workers = {name: Worker() for name in WORKERS}
    pages: OrderedDict[str, str] = OrderedDict()
    numbers = count(1)

    def kept(html: str) -> str:
        """The address of a drawn page."""
        name = str(next(numbers))
        pages[name] = html
        while len(pages) > _PAGES:
            pages.popitem(last=False)
        return f"/page/{name}"

    async def static(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name not in _TYPES:
            return PlainTextResponse("there is no such file", 404)
        text = files("symcheck.workbench").joinpath("static", name).read_bytes()
        return Response(text, media_type=_TYPES[name])

    async def page(request: Request) -> Response:
        html = pages.get(request.path_params["name"])
        if html is None:
            return PlainTextResponse("draw it again", 404)
        headers = {"Content-Security-Policy": _PAGE_POLICY}
        return Response(html, media_type="text/html", headers=headers)

    def project_of(_: Mapping[str, Any]) -> dict[str, Any]:
        from symcheck.workbench.jobs import EXPORTS

        return {
            "folder": str(project.folder),
            "version": __version__,
            "files": project.names(),
            "start": dict(start),
            "options": option_fields(),
            "exports": EXPORTS,
            "endings": {"model": MODELS, "properties": PROPERTIES},
        }

    def renamed(asked: Mapping[str, Any]) -> dict[str, Any]:
        project.rename(_text(asked, "name"), _text(asked, "new"))
        return {}

    def deleted(asked: Mapping[str, Any]) -> dict[str, Any]:
        project.delete(_text(asked, "name"), _text(asked, "version"))
        return {}

    def texts(asked: Mapping[str, Any]) -> Texts:
        return Texts(*(_text(asked, name) for name in Texts._fields))

    answers: dict[str, Callable[[Mapping[str, Any]], Any]] = {
        "project": project_of,
        "read": lambda a: project.read(_text(a, "name"))._asdict(),
        "versions": lambda a: {
            "files": project.names(),
            "versions": {n: project.read(n).version for n in map(str, a["names"])},
        },
        "write": lambda a: {
            "version": project.write(_text(a, "name"), _text(a, "text"), _text(a, "version"))
        },
        "rename": renamed,
        "delete": deleted,
        "analysis": lambda a: analysis(texts(a)),
        "hover": lambda a: {"text": hover(texts(a), _part(a), int(a["at"]))},
        "formatted": lambda a: {"text": formatted(_text(a, "text"))},
        "completions": lambda a: {"items": completions(texts(a), _part(a), int(a["at"]))},
    }

    async def answered(request: Request) -> Response:
        """A question that is answered at once."""
        name = request.path_params["name"]
        if name not in answers:
            return PlainTextResponse("there is no such question", 404)
        try:
            asked = await _asked(request)
            return JSONResponse(await run_in_threadpool(answers[name], asked))
        except SymcheckError as error:  # an answer: other statuses fill the browser's console
            newer = isinstance(error, NewerFileError)
            return JSONResponse({"error": {"message": str(error), "newer": newer}})
        except (KeyError, TypeError, ValueError, OSError) as error:
            return JSONResponse({"error": {"message": f"wrong question: {error!r}"}}, 400)

    async def job(request: Request) -> Response:
        """A job: a line for each message of the worker. It ends if nobody listens any more."""
        worker = workers.get(request.path_params["worker"])
        try:
            asked = await _asked(request)
        except UsageError as error:
            return JSONResponse({"error": {"message": str(error)}}, 400)
        if worker is None:
            return PlainTextResponse("there is no such worker", 404)

        async def lines() -> AsyncIterator[bytes]:
            async with aclosing(worker.ask(asked)) as messages:
                async for message in messages:
                    if await request.is_disconnected() or app.state.is_ending():
                        return
                    result = message.get("result")
                    if isinstance(result, dict) and "html" in result:
                        result["page"] = kept(result.pop("html"))
                    yield json.dumps(message).encode() + b"\n"

        return Stream(lines(), media_type="application/x-ndjson")

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        started = asyncio.gather(workers["check"].start(), workers["simulate"].start())
        yield
        await started
        await asyncio.gather(*(worker.close() for worker in workers.values()))

    app = Starlette(
        routes=[
            Route("/", static),
            Route("/static/{name}", static),
            Route("/page/{name}", page),
            Route("/api/{name}", answered, methods=["POST"]),
            Route("/job/{worker}", job, methods=["POST"]),
        ],
        lifespan=lifespan,
    )
    app.add_middleware(_Guard, access=access)
    app.state.workers = workers
    app.state.is_ending = lambda: False  # the server knows
    return app


_TYPES = {
    "index.html": "text/html",
    "app.js": "text/javascript",
    "style.css": "text/css",
}


async def _asked(request: Request) -> dict[str, Any]:
    """The object that a request holds. Raises UsageError."""
    if int(request.headers.get("content-length", 0)) > _LARGEST:
        raise UsageError("the question is too long")
    try:
        found = json.loads(await request.body())
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise UsageError("a question is a JSON object")
    return found


def _text(asked: Mapping[str, Any], name: str) -> str:
    if not isinstance(asked.get(name), str):
        raise UsageError(f"'{name}' is a text")
    return str(asked[name])


def _part(asked: Mapping[str, Any]) -> str:
    part = _text(asked, "part")
    if part not in ("model", "properties"):
        raise UsageError(f"there is no text '{part}'")
    return part
