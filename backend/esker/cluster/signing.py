"""What nodes show each other: who asks, for which visitor, and that it was not asked before. Pure.

Nodes share one key. Before its first request a node opens a session with the other: each gives a random number, each
shows that it has the key, and from both numbers both make the session's own key. Every request of the session is
counted and signed with that key. The other takes each count once, in any order within a window, as IPsec does (RFC
4303, 3.4.3): what somebody recorded opens nothing, and no clock is asked, however wrong it is.

The signature holds the request line, ``Host``, and what is said of the visitor. Bodies and answers are not signed:
nodes speak over a private network, or over TLS (``--advertise https://…``).
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections import OrderedDict
from dataclasses import dataclass
from typing import Final

from esker.errors import EskerError

HEADER: Final = "esker-node"
"""The field by which a request says that a node passes it on."""
NONCE_BYTES: Final = 16
WINDOW: Final = 4_096
"""Requests of one session that may overtake each other."""
SESSIONS: Final = 1_024
"""Sessions that a node remembers. Of more, those that nobody used go first."""
MOST_HOPS: Final = 1
"""A request is passed on so often. Who gets it then serves it or says that the terrain has moved."""
KEY_CHARACTERS: Final = 32
"""A shared key has so many characters at least."""
NONE: Final = "-"


class NotSigned(EskerError):
    """A request says that a node passes it on, and does not show it. ``renew``: a new session would help."""

    def __init__(self, sentence: str, *, renew: bool = False) -> None:
        super().__init__("not_signed", sentence, 401)
        self.renew = renew


@dataclass(frozen=True)
class Visit:
    """What a node says of a request that it passes on. ``visitor``: the address of who asks; ``scheme``: how; ``hops``:
    how often it was passed on; ``terrain``: what it is about, empty where it is about none."""

    visitor: str
    scheme: str
    hops: int = 1
    terrain: str = ""


def made_key(text: str) -> bytes:
    """Returns the key that a text stands for. Raises ValueError for one that could be guessed.

    >>> len(made_key("correct horse battery staple and more"))
    32
    """
    if len(text) < KEY_CHARACTERS:
        raise ValueError(f"ESKER_CLUSTER_KEY needs {KEY_CHARACTERS} characters at least, the same on every node.")
    return hashlib.sha256(f"esker cluster\0{text}".encode()).digest()


def derived(key: bytes, purpose: str) -> bytes:
    """Returns a key for one purpose, which says nothing about the others."""
    return _mac(key, "derived", purpose)


def _mac(key: bytes, *parts: str) -> bytes:
    """A code over parts, each with its length, so that no two lists of parts are the same text."""
    text = b"".join(len(part.encode()).to_bytes(4) + part.encode() for part in parts)
    return hmac.new(key, text, hashlib.sha256).digest()


@dataclass(frozen=True)
class Opening:
    """What a node sends to open a session: its name, a random number, and a code over both."""

    node: str
    nonce: str
    code: str


@dataclass(frozen=True)
class Opened:
    """What the other answers: the session, its own random number, and a code over all."""

    session: str
    nonce: str
    code: str


def opening(key: bytes, node: str) -> Opening:
    """Begins a session."""
    nonce = secrets.token_hex(NONCE_BYTES)
    return Opening(node, nonce, _mac(key, "opening", node, nonce).hex())


class Window:
    """The counts of a session that came already."""

    def __init__(self) -> None:
        self._newest, self._seen = 0, 0
        """Bit n of ``_seen`` stands for the count that is n before the newest."""

    def take(self, count: int) -> bool:
        """Returns whether this count comes for the first time. One that is older than the window has come."""
        if count < 1:
            return False
        if count > self._newest:
            ahead = count - self._newest
            self._seen = (((self._seen << ahead) if ahead < WINDOW else 0) | 1) & ((1 << WINDOW) - 1)
            self._newest = count
            return True
        behind = self._newest - count
        if behind >= WINDOW or self._seen >> behind & 1:
            return False
        self._seen |= 1 << behind
        return True


class Session:
    """The asking side of a session."""

    def __init__(self, key: bytes, asked: Opening, answer: Opened) -> None:
        """Raises NotSigned where the other does not have the key."""
        code = _mac(key, "opened", asked.node, asked.nonce, answer.session, answer.nonce).hex()
        if not hmac.compare_digest(code, answer.code):
            raise NotSigned("The other node does not have this node's ESKER_CLUSTER_KEY.")
        self._id, self._key = answer.session, _session_key(key, asked.nonce, answer.nonce)
        self._count = 0

    def sign(self, visit: Visit, method: str, target: str, host: str) -> str:
        """Returns the field of a request."""
        self._count += 1
        said = [self._id, str(self._count), str(visit.hops), visit.scheme, visit.visitor, visit.terrain or NONE]
        return " ".join([*said, _mac(self._key, *said, method, target, host).hex()])


def _session_key(key: bytes, asking: str, asked: str) -> bytes:
    return _mac(key, "session", asking, asked)


@dataclass
class _Known:
    key: bytes
    window: Window
    used: bool = False


class Sessions:
    """The asked side: all sessions that others have with this node."""

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._known: OrderedDict[str, _Known] = OrderedDict()

    def __len__(self) -> int:
        return len(self._known)

    def open(self, asked: Opening) -> Opened:
        """Answers an opening. Raises NotSigned."""
        code = _mac(self._key, "opening", asked.node, asked.nonce).hex()
        if len(asked.nonce) != 2 * NONCE_BYTES or not hmac.compare_digest(code.encode(), asked.code.encode()):
            raise NotSigned("This node has another ESKER_CLUSTER_KEY.")
        while len(self._known) >= SESSIONS:
            del self._known[
                next((name for name, each in self._known.items() if not each.used), next(iter(self._known)))
            ]
        name, nonce = secrets.token_hex(8), secrets.token_hex(NONCE_BYTES)
        self._known[name] = _Known(_session_key(self._key, asked.nonce, nonce), Window())
        return Opened(name, nonce, _mac(self._key, "opened", asked.node, asked.nonce, name, nonce).hex())

    def read(self, field: str, method: str, target: str, host: str) -> Visit:
        """Returns what a node says of a request. Raises NotSigned."""
        said = field.split(" ")
        if (
            len(said) != 7
            or len(field) > 1024
            or not (said[1].isascii() and said[1].isdigit() and said[2] in "0123456789")
        ):
            raise NotSigned("This is not how nodes speak.")
        known = self._known.get(said[0])
        if known is None:
            raise NotSigned("This node does not know the session.", renew=True)
        code = _mac(known.key, *said[:6], method, target, host).hex()
        if not hmac.compare_digest(code.encode(), said[6].encode()):
            raise NotSigned("The signature is wrong.")
        if len(said[1]) > 18 or not known.window.take(int(said[1])):
            raise NotSigned("This request came before.", renew=True)
        if not 1 <= int(said[2]) <= MOST_HOPS or said[3] not in ("http", "https"):
            raise NotSigned("This request was passed on too often.")
        known.used = True
        self._known.move_to_end(said[0])
        return Visit(said[4], said[3], int(said[2]), "" if said[5] == NONE else said[5])
