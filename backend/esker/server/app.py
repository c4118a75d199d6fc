"""Puts the routes together."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

from fastapi import FastAPI

from esker.exports.service import Exports
from esker.headers import Headers
from esker.imports import Imports
from esker.server.answers import add_errors
from esker.server.bodies import Bodies
from esker.server.exports import add_exports
from esker.server.history import add_history
from esker.server.imports import add_imports
from esker.server.links import add_links
from esker.server.page import add_page
from esker.server.previews import Pictures, add_previews
from esker.server.socket import add_socket
from esker.server.terrains import add_terrains
from esker.session.hub import Hub
from esker.session.limits import RateByKey
from esker.store.grids import GridStore
from esker.upload import AT_ONCE
from esker.version import VERSION

NEW_TERRAINS: Final = (1 / 3, 60)
"""New terrains by address: rate a second, burst. A whole class may sit behind one address."""
CODE_TRIES: Final = (1 / 3, 60)
"""Join codes by address: of 31^6 codes a guesser tries 360 in the fifteen minutes that one lives."""
IMPORTS: Final = (1 / 6, 20)
"""Elevation files by address."""


def create_app(
    hub: Hub, page: Path, data: Path, pictures: Pictures, grids: GridStore, imports: Imports, exports: Exports
) -> FastAPI:
    """The application over an open hub. ``page``: the built front-end; ``data``: where the LAN certificate lies."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:  # noqa: ARG001
        yield
        await imports.close()
        await exports.close()
        await pictures.previews.close()
        await hub.close()

    app = FastAPI(
        title="Esker",
        version=VERSION,
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
        lifespan=lifespan,
    )
    app.add_middleware(Bodies)
    app.add_middleware(Headers)
    app.state.hub = hub
    app.state.new_terrains = RateByKey(*NEW_TERRAINS)
    app.state.uploads = asyncio.Semaphore(AT_ONCE)
    app.state.code_tries = RateByKey(*CODE_TRIES)
    app.state.imports = RateByKey(*IMPORTS)
    add_errors(app)
    add_imports(app, hub, grids, imports)
    add_terrains(app, hub, grids)
    add_exports(app, exports)
    add_history(app, hub, grids)
    add_links(app, hub)
    add_socket(app, hub)
    add_previews(app, hub, pictures)
    add_page(app, hub, page, data, pictures)
    return app
