"""An op as it is stored."""

from __future__ import annotations

from typing import NamedTuple


class Row(NamedTuple):
    """One op as it is stored. ``op`` is its JSON text; the op's id is ``client:counter``."""

    clock: int
    client: str
    counter: int
    author: str
    op: str

    def ordered_json(self) -> str:
        """The JSON text of the ``OrderedOp``."""
        return ordered_json(self.clock, f"{self.client}:{self.counter}", self.author, self.op)


def ordered_json(clock: int, op_id: str, author: str, op: str) -> str:
    """The JSON text of an ``OrderedOp`` around the already encoded op: ids and authors are plain client ids."""
    return f'{{"clock":{clock},"id":"{op_id}","author":"{author}","op":{op}}}'
