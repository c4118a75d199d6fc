"""The web server: HTTP routes and the websocket (DESIGN 13, docs/protocol.md). The only room that imports FastAPI.

It may know every room that ranks below it.
"""
