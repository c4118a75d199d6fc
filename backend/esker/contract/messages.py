"""Messages of the websocket, text frames (docs/protocol.md)."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import Field, StringConstraints, TypeAdapter

from esker.contract.classes import InClass
from esker.contract.constants import DEFAULT_TAU_PX, MAX_OPS_PER_MESSAGE
from esker.contract.document import Document
from esker.contract.imports import ImportStatus
from esker.contract.lesson import Conduct, Grouping, Lesson, Notice, People
from esker.contract.operations import CloseCode, Op, OpEnvelope, OrderedOp, RejectCode
from esker.contract.tasks import Score
from esker.contract.values import Clock, Colour, Id, Name, OpId, Role, Secret, Ticket, Token, Vec3, Wire

# --- messages: client to server ---------------------------------------------------------------------------------


class Hello(Wire):
    """First message on a socket. ``clock`` asks to resume: the server answers with the missing ops if it can.

    ``at``: to look at the terrain as it was at this clock (or now, if that is earlier), in a room of one's own where
    nothing can be changed; ``seek`` goes to another clock.
    """

    type: Literal["hello"] = "hello"
    protocol: int
    terrain: Id
    secret: Secret
    client: Id
    token: Token | None = None
    """What a ``welcome`` gave this client id: without it nobody comes again under an id that was used."""
    ticket: Ticket | None = None
    """What a ``welcome`` gave this device for this terrain: with it the device is the same person again."""
    name: Name = ""
    colour: Colour | None = None
    clock: Clock | None = None
    at: Clock | None = None


class Ops(Wire):
    type: Literal["ops"] = "ops"
    ops: Annotated[tuple[OpEnvelope, ...], Field(min_length=1, max_length=MAX_OPS_PER_MESSAGE)]


class View(Wire):
    """The camera, from which the server selects the tiles this client needs (DESIGN 7)."""

    type: Literal["view"] = "view"
    eye: Vec3
    target: Vec3
    fov_deg: Annotated[float, Field(gt=1, lt=170)] = 50.0
    width: Annotated[int, Field(ge=1, le=16384)] = 1024
    height: Annotated[int, Field(ge=1, le=16384)] = 768
    tau_px: Annotated[float, Field(ge=0.25, le=64)] = DEFAULT_TAU_PX


class Presence(Wire):
    """Ephemeral: never journaled, never on the document clock."""

    type: Literal["presence"] = "presence"
    cursor: Vec3 | None = None
    tool: Annotated[str, StringConstraints(max_length=24)] = ""
    stroke: Id | None = None
    eye: Vec3 | None = None
    target: Vec3 | None = None


class Credit(Wire):
    """Bytes of tile frames that the client has applied since its last credit."""

    type: Literal["credit"] = "credit"
    bytes: Annotated[int, Field(ge=0, le=2**31)]


class Rename(Wire):
    type: Literal["rename"] = "rename"
    name: Name
    colour: Colour | None = None


class Seek(Wire):
    """Only after a ``hello`` with ``at``: show the terrain as it was at another clock.

    Answered by ``ordered`` with the ops in between, where they are few and ``clock`` is later, else by a ``welcome``
    with the document; of seeks that come before an answer the last one counts.
    """

    type: Literal["seek"] = "seek"
    clock: Clock


class Ping(Wire):
    type: Literal["ping"] = "ping"
    t: float


ClientMessage = Annotated[
    Hello | Ops | View | Presence | Credit | Rename | Seek | Ping | Conduct | People | Grouping,
    Field(discriminator="type"),
]


# --- messages: server to client ---------------------------------------------------------------------------------


class Member(Wire):
    client: Id
    name: Name
    colour: Colour
    role: Role
    person: Id = "-"
    """Who it is, the same over reloads of the page."""
    conducts: bool = False
    pen: bool = False
    """Whether they may draw while hands are off."""


class Welcome(Wire):
    """Answer to ``hello``: either ``document`` (a snapshot) or ``ops`` (what was missed since the client's clock)."""

    type: Literal["welcome"] = "welcome"
    protocol: int
    server: str
    client: Id
    token: str
    """To be shown in the next ``hello`` of this client id. It is bound to the link."""
    ticket: str = ""
    """To be kept by the device, for this terrain, and shown in every ``hello``: a secret."""
    role: Role
    colour: Colour
    levels: int
    """Finest globally solved level G."""
    finest: int
    """Finest level that tiles are refined to where somebody looks; G when nothing is refined."""
    clock: Clock
    document: Document | None = None
    ops: tuple[OrderedOp, ...] | None = None
    members: tuple[Member, ...]
    device: str
    lesson: Lesson | None = None


class Ack(Wire):
    """These ops are committed to the journal. ``clocks[i]`` belongs to ``ids[i]``; sent to their author.

    For ops ordered now it follows the ``ordered`` message that carries them. For an op sent again that the journal
    already holds (a resume), it comes alone: the client got the op itself in ``welcome``.
    """

    type: Literal["ack"] = "ack"
    ids: tuple[OpId, ...]
    clocks: tuple[Clock, ...]


class Reject(Wire):
    type: Literal["reject"] = "reject"
    id: OpId
    code: RejectCode
    message: str


class OpsBroadcast(Wire):
    """What one tick committed, in clock order, without gaps, the same text for every member.

    It holds the reader's own ops too: apply them to the confirmed document at their place and drop them from the
    unconfirmed ones (by id); the ``ack`` that follows then names ids that are no longer pending, which is fine.
    """

    type: Literal["ordered"] = "ordered"
    ops: tuple[OrderedOp, ...]


class Members(Wire):
    type: Literal["members"] = "members"
    members: tuple[Member, ...]


class MemberPresence(Wire):
    client: Id
    cursor: Vec3 | None = None
    tool: str = ""
    stroke: Id | None = None
    eye: Vec3 | None = None
    target: Vec3 | None = None


class PresenceBroadcast(Wire):
    type: Literal["presences"] = "presences"
    members: tuple[MemberPresence, ...]


class Progress(Wire):
    """Where the solver stands. ``settled`` is true when every level is final for ``clock``."""

    type: Literal["progress"] = "progress"
    clock: Clock
    level: int
    of: int
    settled: bool
    note: str = ""
    refining: Annotated[int, Field(ge=0)] = 0
    """Tiles above the global levels that somebody looks at and that are still to be made."""
    laying: bool = False
    """Whether the server makes the base of the elevation layers and takes long for it."""


class ErrorMessage(Wire):
    type: Literal["error"] = "error"
    code: CloseCode
    message: str
    fatal: bool
    ticket: str = ""
    """With the code ``removed``: of who may be let in; to be kept as that of a ``welcome``."""


class Pong(Wire):
    type: Literal["pong"] = "pong"
    t: float


class Importing(Wire):
    """Somebody brings in an elevation file: for everybody to see. Sent at each stage, at most 5 times a second."""

    type: Literal["importing"] = "importing"
    author: Name
    file: Name
    status: ImportStatus


ServerMessage = Annotated[
    Welcome
    | Ack
    | Reject
    | OpsBroadcast
    | Members
    | PresenceBroadcast
    | Progress
    | ErrorMessage
    | Pong
    | Importing
    | Lesson
    | Notice
    | InClass
    | Score,
    Field(discriminator="type"),
]

OP: Final[TypeAdapter[Any]] = TypeAdapter(Op)
CLIENT_MESSAGE: Final[TypeAdapter[Any]] = TypeAdapter(ClientMessage)
SERVER_MESSAGE: Final[TypeAdapter[Any]] = TypeAdapter(ServerMessage)
