"""Security and caching headers on every HTTP answer, as plain ASGI middleware."""

from __future__ import annotations

from typing import Any, Final

SECURITY: Final = [
    (
        b"content-security-policy",
        b"default-src 'self'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
        b"connect-src 'self'; worker-src 'self' blob:; object-src 'none'; base-uri 'none'; form-action 'none'; "
        b"frame-ancestors 'none'",
    ),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"permissions-policy", b"camera=(), microphone=(), geolocation=()"),
]
STRICT: Final = (b"strict-transport-security", b"max-age=31536000")
IMMUTABLE: Final = (b"cache-control", b"public, max-age=31536000, immutable")
FRESH: Final = (b"cache-control", b"no-cache")


class Headers:
    """Files whose name holds their hash (``/assets/``) may be kept for ever; all else is asked for again."""

    def __init__(self, app: Any, strict: bool = False) -> None:
        """``strict``: browsers that came by HTTPS are told to come by nothing else for a year."""
        self.app, self._strict = app, strict

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                hashed = scope["path"].startswith("/assets/") and message["status"] == 200
                kept = [pair for pair in message["headers"] if pair[0] != b"cache-control"]
                message["headers"] = [*kept, *SECURITY, IMMUTABLE if hashed else FRESH]
                if self._strict and scope.get("scheme") == "https":
                    message["headers"].append(STRICT)
            await send(message)

        await self.app(scope, receive, with_headers)
