"""The console on the REST door: the page at `/`, and its files below `/console/`."""

from pathlib import Path

from fastapi import FastAPI, Request, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from shipshape import console
from shipshape.serving.faults import FaultKind
from shipshape.serving.rest.problems import document, identify

NOT_BUILT = (
    "expected the console in this installation, got one without it: make console builds it in a checkout, "
    "before the service is installed"
)


def add_console(app: FastAPI, folder: Path | None) -> None:
    """Give `app` the console; where there is none, `/` says so.

    Args:
        app: The REST door's.
        folder: From `console.built`.
    """
    if folder is None:
        app.add_route(console.ROOT, _not_built, methods=["GET"], include_in_schema=False)
        return
    files = _Files(folder)

    async def page(request: Request) -> Response:
        """The page itself."""
        return await files.get_response(console.PAGE, request.scope)

    app.add_route(console.ROOT, page, methods=["GET"], include_in_schema=False)
    app.mount(console.FOLDER, files)


class _Files(StaticFiles):
    """Files with the headers of the console."""

    def __init__(self, folder: Path) -> None:
        super().__init__(directory=folder)

    async def get_response(self, path: str, scope: Scope) -> Response:
        """A file, or 404."""
        response = await super().get_response(path, scope)
        response.headers.update(console.HEADERS)
        return response


async def _not_built(request: Request) -> Response:
    identify(request.scope)
    return document(404, title="Not Found", detail=NOT_BUILT, error=FaultKind.INVALID_INPUT)
