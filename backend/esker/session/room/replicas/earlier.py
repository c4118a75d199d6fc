"""The replica of whoever looks at a terrain as it was; to some only what is there now as well may be shown."""

from __future__ import annotations

from esker.document.ops import StrokeSet
from esker.document.wire import document_json
from esker.session.lesson.rules import Lesson
from esker.session.room.members import Member
from esker.session.room.replicas.replicas import Replicas
from esker.session.room.replicas.viewing import Key, shown
from esker.store.journal import Loaded


class EarlierReplica(Replicas):
    """The one replica in a view of the history."""

    def __init__(self, loaded: Loaded, lesson: Lesson, still: frozenset[Key] | None) -> None:
        """``still``: the things that are there now, where nothing else may be shown; None: everything is."""
        super().__init__(loaded, lesson)
        self.still = still

    def turn(self, still: frozenset[Key] | None) -> None:
        """Other things are there now."""
        if still != self.still:
            self.still = still
            self._kept.clear()

    def looks(self, member: Member) -> bool:  # noqa: ARG002
        """Returns whether only what is still there is shown."""
        return self.still is not None

    def encoded(self, document: StrokeSet, view: bool) -> bytes:
        """Returns the document as JSON; ``view``: what of it is still there."""
        if not view:
            return super().encoded(document, view)
        return document_json(shown(document.to_document(), self.still)).encode()
