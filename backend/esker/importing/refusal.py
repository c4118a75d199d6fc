"""How an import ends when it does not end well."""

from __future__ import annotations


class ImportRefused(Exception):
    """The file cannot be taken; the message is a sentence for a person: why, and where it helps what to do."""


class ImportCancelled(Exception):
    """Somebody asked to stop the import; nothing of it is left."""
