"""The web application: all routes together."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

from fastapi import FastAPI, Request

from esker.cluster.passing import Entrance, Passing
from esker.fairness.laps import Laps
from esker.fairness.shares import Places, Rate, Rates, Share
from esker.fairness.turns import Turns
from esker.jobs import Imports
from esker.jobs.exports import Exports
from esker.keeper.private import Key
from esker.lesson.classes import Classes
from esker.lesson.collect import Collections
from esker.server.nodes import Member
from esker.server.routes.answers import add_errors
from esker.server.routes.classes import add_classes
from esker.server.routes.deletion import add_deletion
from esker.server.routes.exports import add_exports
from esker.server.routes.health import add_health
from esker.server.routes.history import add_history
from esker.server.routes.imports import add_imports
from esker.server.routes.keeper import add_keeper
from esker.server.routes.links import add_links
from esker.server.routes.metrics import Gauges, add_metrics
from esker.server.routes.page import add_page
from esker.server.routes.previews import Pictures, add_previews
from esker.server.routes.socket import add_socket
from esker.server.routes.terrains import add_terrains
from esker.server.routes.wall import add_wall
from esker.server.upload import AT_ONCE
from esker.server.wire import tls
from esker.server.wire.bodies import Bodies
from esker.server.wire.descriptors import watch
from esker.server.wire.front import Forwarded, Front, Gate
from esker.server.wire.headers import Headers
from esker.server.wire.pacing import Paced
from esker.session.room.hub import Hub
from esker.store.grids import GridStore
from esker.version import VERSION

NEW_TERRAINS: Final = (1 / 3, 60)
"""New terrains by address: rate a second, burst. A whole class may sit behind one address."""
CODE_TRIES: Final = (1 / 3, 60)
"""Join codes by address: right or wrong, as a whole class types at once."""
NEW_CODES: Final = (0.2, 60)
"""Join codes that are made, by address and by link: codes become longer for all where many live."""
NEW_LINKS: Final = (2.0, 200)
"""Links that are made or renewed, by address: each is a line of the database and a commit."""
WRONG_CODES: Final = (0.5, 300)
"""Wrong codes of the whole server: of 10^8 for each that lives, all guessers together try 750 in fifteen minutes."""
ALL_NEW_TERRAINS: Final = (5.0, 600)
"""New terrains of all addresses together."""
UPLOADS: Final = Share(16, address=6, network=8)
"""Terrain files that are on their way or being read at a time."""
IMPORTS: Final = (1 / 6, 20)
"""Elevation files by address."""


def create_app(
    hub: Hub,
    page: Path,
    data: Path,
    pictures: Pictures,
    grids: GridStore,
    imports: Imports,
    exports: Exports,
    key: Key,
    front: Front,
    member: Member | None = None,
    gauges: Gauges | None = None,
) -> FastAPI:
    """The application over an open hub. ``page``: the built front-end; ``data``: where the LAN certificate lies;
    ``key``: of the machine's owner; ``front``: how it is reached; ``member``: this server as one of several;
    ``gauges``: figures that are given out."""
    cluster = None if member is None else member.cluster

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:  # noqa: ARG001
        watching = asyncio.create_task(watch())
        yield
        watching.cancel()
        await imports.close()
        await exports.close()
        await collections.close()
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
    laps = Laps()
    _stand_before(app, front, member, laps)
    classes = Classes(hub, grids, laps.is_shared)
    collections = Collections(classes, data / "collections")
    if member is not None and member.rooms is not None:
        member.rooms.jobs += [imports, exports, collections]
    app.state.hub = hub
    app.state.nodes = (lambda: 1) if cluster is None else (lambda: max(1, len(cluster.nodes)))
    _allow(app)
    add_errors(app)
    add_imports(app, hub, grids, imports)
    add_terrains(app, hub, grids)
    add_exports(app, hub, exports)
    add_deletion(app, hub, classes)
    add_classes(app, classes, collections)
    add_wall(app, classes, front, laps, cluster)
    add_health(app, hub, cluster)
    if gauges is not None:
        add_metrics(app, gauges)
    add_history(app, hub, grids)

    def warned(request: Request) -> bool:
        """Whether somebody came to the certificate that ``--lan`` made."""
        own = data / tls.FOLDER / tls.CA_FILE
        return request.url.scheme == "https" and front.origin is None and own.is_file()

    add_links(app, hub, warned)
    add_keeper(app, hub, key)
    add_socket(app, hub, front, laps, cluster)
    add_previews(app, hub, pictures)
    add_page(app, hub, page, data, pictures)
    return app


def _stand_before(app: FastAPI, front: Front, member: Member | None, laps: Laps) -> None:
    """Adds what each request passes before its route; who is added last is passed first."""
    app.add_middleware(Bodies)
    if member is not None and member.rooms is not None:
        app.add_middleware(Passing, cluster=member.cluster, terrain_of=member.rooms.terrain_of)
    app.add_middleware(Gate, front=front)
    app.add_middleware(Paced, laps=laps)
    app.add_middleware(Headers, strict=front.strict)
    app.add_middleware(Forwarded, front=front)
    if member is not None:
        app.add_middleware(Entrance, cluster=member.cluster)


def _allow(app: FastAPI) -> None:
    """Adds what routes may be asked for: rates, and places for uploads."""
    app.state.new_terrains = Rates(Rate(*NEW_TERRAINS), total=Rate(*ALL_NEW_TERRAINS))
    app.state.uploads = Turns(AT_ONCE)
    app.state.receiving = Places(UPLOADS)
    app.state.code_tries = Rates(Rate(*CODE_TRIES))
    app.state.new_codes = Rates(Rate(*NEW_CODES), link=Rate(*NEW_CODES))
    app.state.new_links = Rates(Rate(*NEW_LINKS))
    app.state.wrong_codes = Rates(total=Rate(*WRONG_CODES))
    app.state.imports = Rates(Rate(*IMPORTS))
