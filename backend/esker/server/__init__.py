"""The web server: HTTP routes and the websocket (DESIGN 13, docs/protocol.md). The only room that imports FastAPI."""

from esker.server.app import create_app
from esker.server.previews import Pictures

__all__ = ["Pictures", "create_app"]
