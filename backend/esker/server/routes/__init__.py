"""The routes of the web server, one file for each thing that is asked for (docs/protocol.md).

A route knows the rooms that answer it and ``server.wire``; no route knows how a server is put together.
"""
