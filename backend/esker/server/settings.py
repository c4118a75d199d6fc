"""Settings: the environment (``ESKER_*``) and the command line, frozen (DESIGN 2)."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from esker import contract as c
from esker.resources import PAGE


class BadSetting(ValueError):
    """A setting that cannot be used; the message names it."""


@dataclass(frozen=True)
class Settings:
    """How this server runs. Limits may be lowered below those of the contract, never raised."""

    host: str = "127.0.0.1"
    port: int = 8000
    data: Path = Path("data")
    page: Path = PAGE
    lan: bool = False
    new_terrain: bool = False
    """Whether a start prints a new terrain, and not that of the last start."""
    public_url: str | None = None
    """Where people reach this server, when it stands behind a proxy: https://terrain.example.org"""
    forwarded_allow_ips: str = "127.0.0.1"
    """Proxies whose X-Forwarded-For is believed, as addresses and networks. "*": any that connects, for what it
    adds."""
    hosts: str = ""
    """More names by which people reach this server, separated by commas; they stand in the ``Host`` of requests."""
    level: int = c.DEFAULT_LEVEL
    refine: int = c.DEFAULT_REFINED_LEVEL
    """The finest level that is refined tile by tile where somebody looks. With one at or below ``level`` none is."""
    device: str | None = None
    threads: int | None = None
    max_members: int = c.MAX_MEMBERS
    max_strokes: int = c.MAX_STROKES
    max_points: int = c.MAX_POINTS_PER_STROKE
    grid_quota_mb: int = 4096
    """MiB that the elevation grids of one terrain may take on disk."""
    history_quota_mb: int = 256
    """MiB that the operations of one terrain may take in the database."""
    storage_mb: int = 0
    """MiB that all of the data folder may take. 0: all that the disk has, but for the part that stays free."""
    log_level: str = "info"
    database: str = field(default="", repr=False)
    """PostgreSQL that several servers share: postgresql://user@host/name. Empty: SQLite in the data folder."""
    blobs: str = ""
    """Where servers have elevation grids together: s3://bucket/prefix. Empty: each in its data folder."""
    node: str = ""
    """The name of this server among several over one database. Empty: it is alone."""
    advertise: str = ""
    """Where the other nodes reach this one: http://10.0.0.5:8000"""
    cluster_key: str = field(default="", repr=False)
    """What all nodes of a cluster have together, and nobody else."""
    previews: bool = True
    """Whether pictures of shared terrains are drawn: each takes some eight seconds of a processor, at the lowest
    priority."""
    metrics: str = ""
    """Who may read ``/metrics``: addresses and networks, separated by commas. "*": everybody. Empty: nobody."""

    def __post_init__(self) -> None:
        bounds = {
            "port": (0, 65535),
            "level": (0, c.MAX_LEVEL),
            "refine": (0, c.MAX_REFINED_LEVEL),
            "max_members": (1, c.MAX_MEMBERS),
            "max_strokes": (1, c.MAX_STROKES),
            "max_points": (2, c.MAX_POINTS_PER_STROKE),
            "grid_quota_mb": (1, 2**24),
            "history_quota_mb": (1, 2**24),
            "storage_mb": (0, 2**30),
        }
        for name, (low, high) in bounds.items():
            if not low <= getattr(self, name) <= high:
                raise BadSetting(f"{name} must lie between {low} and {high}, not {getattr(self, name)}.")
        if self.database and not self.database.startswith(("postgresql://", "postgres://")):
            raise BadSetting("ESKER_DATABASE must begin with postgresql://; without it the data folder is used.")
        if self.threads is not None and self.threads < 1:
            raise BadSetting("threads must be at least 1.")
        if self.log_level not in ("debug", "info", "warning", "error"):
            raise BadSetting("log_level must be one of debug, info, warning, error.")


def from_environment(environ: Mapping[str, str] | None = None, **over: Any) -> Settings:
    """Settings from ``ESKER_HOST``, ``ESKER_PORT`` and so on; ``over`` (the command line) wins where not None.

    Raises BadSetting.
    """
    environ = os.environ if environ is None else environ
    settings = Settings()
    found: dict[str, Any] = {}
    for name, default in vars(settings).items():
        text = environ.get(f"ESKER_{name.upper()}")
        if text is not None and text != "":
            found[name] = _parse(name, text, default)
    found |= {name: value for name, value in over.items() if value is not None}
    return replace(settings, **found)


def _parse(name: str, text: str, default: object) -> object:
    if isinstance(default, bool):
        return text.lower() in ("1", "true", "yes", "on")
    if isinstance(default, int) or name == "threads":
        try:
            return int(text)
        except ValueError:
            raise BadSetting(f"ESKER_{name.upper()} must be a whole number, not {text!r}.") from None
    if isinstance(default, Path):
        return Path(text)
    return text
