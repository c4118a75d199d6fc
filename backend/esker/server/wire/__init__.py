"""The layer between the network and the application: HTTP, websockets, TLS, headers, bodies.

No file here knows a route.
"""
