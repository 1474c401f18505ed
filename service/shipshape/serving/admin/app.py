"""The admin door as an ASGI application: check the token, delegate to `Control`, answer in JSON."""

from importlib.metadata import version
from typing import Annotated, Any

from fastapi import Body, FastAPI
from starlette.types import ASGIApp

from shipshape.serving.access import Access
from shipshape.serving.admin.control import Control, Json
from shipshape.serving.admin.problems import add_refusals
from shipshape.serving.rest.doorkeeper import Doorkeeper
from shipshape.serving.rest.problems import add_handlers
from shipshape.serving.tokens import Tokens

MOST_BYTES = 64 * 2**10  # of a body, which names a folder


def build_admin_app(control: Control, tokens: Tokens) -> ASGIApp:
    """The application; every path needs a token, of which nothing is read without one.

    The handlers are no coroutines, so that a swap of seconds takes a thread and not the event loop.
    """
    app = FastAPI(
        title="Shipshape admin",
        version=version("shipshape"),
        docs_url=None,
        redoc_url=None,
        max_body_size=MOST_BYTES,
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
    return Doorkeeper(app, Access(tokens=tokens))
