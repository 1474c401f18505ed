"""The admin door as an ASGI application: check the token, delegate to `Control`, answer in JSON."""

from importlib.metadata import version
from typing import Annotated, Any

from fastapi import Body, Depends, FastAPI, Request

from shipshape.errors import Unauthenticated
from shipshape.serving.admin.control import Control, Json
from shipshape.serving.admin.problems import add_refusals
from shipshape.serving.rest.problems import add_handlers
from shipshape.serving.tokens import Tokens

SCHEME = "bearer"


def build_admin_app(control: Control, tokens: Tokens) -> FastAPI:
    """The application; every call but the contract itself needs a token.

    The handlers are no coroutines, so that a swap of seconds takes a thread and not the event loop.
    """
    app = FastAPI(
        title="Shipshape admin",
        version=version("shipshape"),
        docs_url=None,
        redoc_url=None,
        dependencies=[Depends(_with_token(tokens))],
    )

    def swap(folder: Annotated[str, Body(embed=True, description="Absolute, or below bundle_root.")]) -> Json:
        """Try the bundle in a folder out and let it answer; the one before is kept."""
        return control.swap(folder)

    def shadow(folder: Annotated[str, Body(embed=True, description="Absolute, or below bundle_root.")]) -> Json:
        """Try the bundle in a folder out and compare its answers with those of the running one."""
        return control.shadow(folder)

    def add(path: str, handler: Any, method: str) -> None:
        """One path; its name in the contract is that of its handler."""
        app.add_api_route(path, handler, methods=[method], operation_id=handler.__name__)

    add("/admin/status", control.status, "GET")
    add("/admin/bundle", swap, "POST")
    add("/admin/rollback", control.rollback, "POST")
    add("/admin/shadow", shadow, "POST")
    add("/admin/unshadow", control.unshadow, "POST")
    add("/admin/promote", control.promote, "POST")
    add("/admin/drain", control.drain, "POST")
    add("/admin/resume", control.resume, "POST")
    add_handlers(app)
    add_refusals(app)
    return app


def _with_token(tokens: Tokens) -> Any:
    def check(request: Request) -> None:
        """Raises Unauthenticated without a token of the file."""
        scheme, _, token = request.headers.get("authorization", "").partition(" ")
        if scheme.lower() != SCHEME or tokens.name_of(token.strip()) is None:
            raise Unauthenticated("expected a token of the admin token file in Authorization: Bearer, got none")

    return check
