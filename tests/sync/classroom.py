"""A teacher and two pupils in one terrain, for tests of lessons over real sockets."""

from __future__ import annotations

from typing import Any, NamedTuple

from esker import contract as c
from tests.sync.harness import LiveServer, Peer


class Class(NamedTuple):
    """A terrain with a teacher and two pupils, who came by one link that lets draw."""

    terrain: str
    owner: str
    edit: str
    teacher: Peer
    anne: Peer
    ben: Peer


def person(peer: Peer) -> str:
    """Who a member is."""
    client = peer.welcome["client"]
    return str(next(m["person"] for m in peer.welcome["members"] if m["client"] == client))


def come(server: LiveServer, room: tuple[str, str], client: str, **hello: Any) -> Peer:
    """Somebody who comes in by a link (terrain, secret)."""
    return server.join(*room, client, **hello)


def a_class(server: LiveServer, tag: str) -> Class:
    terrain, owner = server.create()
    _, made = server.http("POST", f"/api/terrains/{terrain}/links", {"role": "edit"}, owner)
    edit = made["secret"]
    teacher = server.join(terrain, owner, f"{tag}-t", name="Ms Ray")
    anne = server.join(terrain, edit, f"{tag}-a", name="Anne")
    ben = server.join(terrain, edit, f"{tag}-b", name="Ben")
    return Class(terrain, owner, edit, teacher, anne, ben)


def lesson(peer: Peer, **wanted: Any) -> dict[str, Any]:
    """The next state of the lesson that has these values."""
    while True:
        found = peer.wait("lesson")
        if all(found[key] == value for key, value in wanted.items()):
            return found


def people(peer: Peer, action: str, *others: Peer) -> None:
    peer.say("people", action=action, people=[person(each) for each in others])


def answer(peer: Peer, op_id: str, op: dict[str, Any]) -> dict[str, Any]:
    """What the server says to an op: ``ack`` or ``reject``."""
    peer.ops((op_id, op))
    return peer.wait("ack", "reject")


def strokes(server: LiveServer, room: Class) -> dict[str, Any]:
    _, document = server.http("GET", f"/api/terrains/{room.terrain}/document", secret=room.owner)
    return {each["id"]: each for each in document["strokes"]}


def refused_at(server: LiveServer, room: Class, client: str, secret: str = "", **hello: Any) -> dict[str, Any]:
    """The farewell of somebody who may not come in."""
    peer = Peer(server.socket())
    fields = {"protocol": c.PROTOCOL_VERSION, "terrain": room.terrain, "secret": secret or room.edit, "client": client}
    peer.say("hello", **fields, **hello)
    code, error = peer.closed()
    assert code == c.WS_CLOSE["removed"]
    assert error is not None
    return error
