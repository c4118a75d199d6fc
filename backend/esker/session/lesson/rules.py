"""The rules of one lesson: what its state lets whom do and see. No I/O, no time (DESIGN 19).

The state that is held here is enforced at once; whoever holds this tells people of it when it is in the journal.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from esker import contract as c
from esker.contract import RejectCode, Role
from esker.session.lesson import groups, names
from esker.session.lesson.state import MOST, Removed, State, with_people, without

HANDS_OFF: Final = "Hands off: whoever leads the lesson has paused drawing for now."
PROTECTED: Final = "Whoever leads the lesson protects this; it cannot be changed by others."
TASK: Final = "Only whoever leads this terrain changes its task."
SETTINGS: Final = "Whoever leads the lesson protects the settings of the terrain."
REMOVED: Final = "You were sent out of this terrain. Ask whoever leads it to let you in again."
WAIT: Final = (
    "Somebody with your address was sent out, so whoever leads this terrain must let you in. Ask them, then try again."
)
TASK_FIELDS: Final = frozenset({"task", "task_pictures"})
"""Settings that only conductors change, protected or not."""
MOST_WAITING: Final = 50
"""The server remembers so many people who ask to be let in."""


class Somebody(Protocol):
    """A member, or whoever asks to be one."""

    @property
    def role(self) -> Role: ...

    @property
    def person(self) -> str: ...


@dataclass(frozen=True)
class Hand:
    """By whose hand a client's things came, and whether they conducted then."""

    person: str
    conducts: bool


class Lesson:
    """The rules of one room, with the state that is enforced."""

    def __init__(
        self,
        state: State | None = None,
        makers: Mapping[str, str] | None = None,
        hands: Mapping[str, Hand] | None = None,
    ) -> None:
        """``makers``: clients by things that came since there are lessons; ``hands``: whose these clients are."""
        self.state = state or State()
        self._makers, self._hands = dict(makers or {}), dict(hands or {})
        self._in_hand: dict[str, str] = {}
        self._numbers = dict(self.state.named)
        self.waiting: OrderedDict[str, str] = OrderedDict()
        """Who waits to be let in: names by person."""

    # --- who may what -------------------------------------------------------------------------------------------

    def conducts(self, who: Somebody) -> bool:
        """Whether somebody leads: owners do, and whom an owner has named, if their link lets them draw."""
        return who.role == "owner" or (who.role == "edit" and who.person in self.state.conductors)

    def draws(self, who: Somebody) -> bool:
        """Whether somebody may change the document now."""
        if who.role == "view":
            return False
        return not self.state.hands_off or self.conducts(who) or who.person in self.state.pens

    def refusal(self, who: Somebody, op: c.Op) -> tuple[RejectCode, str] | None:
        """Why an op of somebody's is not taken now: a code and a sentence."""
        if not self.draws(who):
            return "hands_off", HANDS_OFF
        if self.conducts(who):
            return None
        if any(_sets_task(part) for part in (op.ops if isinstance(op, c.Group) else (op,))):
            return "leaders_only", TASK
        if not self.state.protect:
            return None
        for part in op.ops if isinstance(op, c.Group) else (op,):
            if isinstance(part, c.SetTerrain):
                return "protected", SETTINGS
            thing = _thing(part)
            if thing is not None and self.protected(thing):
                return "protected", PROTECTED
        return None

    def protected(self, thing: str) -> bool:
        """Whether a stroke or a layer is a conductor's, or was there before anybody is known to have brought it."""
        hand = self._hands.get(self._makers.get(thing, ""))
        return hand is None or hand.conducts or hand.person in self.state.conductors

    def made(self, op: c.Op, client: str, who: Somebody | None) -> None:
        """Somebody's op was ordered: what it brings is theirs."""
        if who is not None:
            self._hands[client] = Hand(who.person, self.conducts(who))
        for part in op.ops if isinstance(op, c.Group) else (op,):
            match part:
                case c.BeginStroke(stroke=stroke):
                    self._makers[stroke.id] = client
                    if not stroke.finished:
                        self._in_hand[stroke.id] = client
                case c.AddLayer(layer=layer):
                    self._makers[layer.id] = client
                case c.FinishStroke(stroke=stroke_id) | c.DeleteStroke(stroke=stroke_id):
                    self._in_hand.pop(stroke_id, None)
        while len(self._in_hand) > MOST:
            del self._in_hand[next(iter(self._in_hand))]

    def in_hand(self) -> dict[str, list[str]]:
        """Strokes that were begun here and are not finished, by the client that draws them."""
        found: dict[str, list[str]] = {}
        for stroke, client in self._in_hand.items():
            found.setdefault(client, []).append(stroke)
        return found

    def clients_of(self, people: Iterable[str]) -> set[str]:
        """The clients that these people are known to have had; who is nobody's id counts as a client."""
        wanted = set(people)
        return {client for client, hand in self._hands.items() if hand.person in wanted or client in wanted} | {
            each for each in wanted if not any(hand.person == each for hand in self._hands.values())
        }

    # --- who sees what ------------------------------------------------------------------------------------------

    def sees(self, who: Somebody, other: Somebody) -> bool:
        """Whether somebody is told of another member."""
        return not self.state.hide or who.person == other.person or self.conducts(who) or self.conducts(other)

    def nameless(self, who: Somebody) -> bool:
        """Whether somebody is shown a document without the names of who drew it."""
        return self.state.hide and not self.conducts(who)

    def name(self, who: Somebody, own: str) -> str:
        """What somebody is called by the others, who calls themself ``own``."""
        if not self.state.animals or self.conducts(who):
            return own
        if who.person not in self._numbers:
            while len(self._numbers) >= MOST:
                del self._numbers[next(iter(self._numbers))]
            self._numbers[who.person] = names.choose(who.person, set(self._numbers.values()))
        return names.animal(self._numbers[who.person], self.state.animals)

    def signed(self, who: Somebody, name: str, op: c.Op) -> c.Op:
        """An op as it goes into the journal: where people's own names are not wanted it brings none."""
        if self.conducts(who) or not (self.state.animals or self.state.hide):
            return op
        shown = name if self.state.animals else ""
        if isinstance(op, c.Group):
            return op.model_copy(update={"ops": tuple(_signed(part, shown) for part in op.ops)})
        return _signed(op, shown)

    def message_for(self, who: Somebody, look: str | None) -> c.Lesson:
        """How the lesson stands, as somebody may know it. ``look``: the client whose view all follow."""
        state, conducts = self.state, self.conducts(who)
        out = {each.person: each.name for each in state.removed} if conducts else {}
        removed = tuple(c.Outsider(person=person, name=name) for person, name in out.items())
        waiting = tuple(c.Outsider(person=k, name=name) for k, name in self.waiting.items()) if conducts else ()
        return c.Lesson(
            hands_off=state.hands_off,
            protect=state.protect,
            hide=state.hide,
            animals=state.animals,
            look=look,
            held=state.held,
            draws=self.draws(who),
            conducts=conducts,
            removed=removed,
            waiting=waiting,
            groups=state.groups if conducts else (),
        )

    # --- the door -----------------------------------------------------------------------------------------------

    def door(self, who: Somebody, since: int | None, address: str) -> str | None:
        """Why somebody may not come in, as a sentence. ``since``: when they got their ticket, None: they have none.

        Whoever was removed stays out with their ticket. Without one anybody from their address is a stranger, who
        waits to be let in; who has an older ticket was here before and is somebody else.
        """
        state = self.state
        if who.role == "owner":
            return None
        if any(each.person == who.person for each in state.removed):
            return REMOVED
        if who.person in state.let_in or who.person in state.conductors:
            return None
        stranger = any(each.address == address and (since is None or since >= each.at) for each in state.removed)
        return WAIT if stranger else None

    def waits(self, person: str, name: str) -> bool:
        """Somebody asks to be let in; whether that is news."""
        news = person not in self.waiting
        self.waiting[person] = name
        while len(self.waiting) > MOST_WAITING:
            self.waiting.popitem(last=False)
        return news

    # --- changes ------------------------------------------------------------------------------------------------

    def switched(self, message: c.Conduct, who: Somebody) -> State:
        """The state after a conductor's switches."""
        wanted = {
            name: value
            for name in ("hands_off", "protect", "hide", "animals", "held")
            if (value := getattr(message, name)) is not None
        }
        if message.look is not None:
            wanted |= {"look": who.person if message.look else None}
            if not message.look:
                wanted |= {"held": False}
        return self._named(wanted)

    def turned(self, message: c.People) -> State:
        """The state after what a conductor did about people: all but to remove them, and to undo."""
        people, state = message.people, self.state
        match message.action:
            case "pen":
                return self._named({"pens": with_people(state.pens, people)})
            case "no_pen":
                return self._named({"pens": without(state.pens, people)})
            case "conductor":
                return self._named({"conductors": with_people(state.conductors, people)})
            case "no_conductor":
                look = None if state.look in people else state.look
                return self._named({"conductors": without(state.conductors, people), "look": look})
            case "let_in":
                for person in people:
                    self.waiting.pop(person, None)
                inside = frozenset(people)
                removed = tuple(each for each in state.removed if each.person not in inside)
                return self._named({"removed": removed, "let_in": with_people(state.let_in, people)})
        return state

    def grouped(self, message: c.Grouping) -> State | c.NoticeCode:
        """The state after what a conductor changed of groups; or the notice that says why that cannot be."""
        state = self.state
        after = groups.changed(state.groups, message)
        if isinstance(after, str):
            return after
        return self._named({"groups": after, "pens": groups.pens(state.pens, state.groups, after)})

    def sent_out(self, out: Iterable[Removed]) -> State:
        """The state after these people were removed."""
        new = tuple(out)
        people = tuple(each.person for each in new)
        state, outside = self.state, frozenset(people)
        for person in people:
            self.waiting.pop(person, None)
        return self._named(
            {
                "removed": (*(each for each in state.removed if each.person not in outside), *new)[-MOST:],
                "pens": without(state.pens, people),
                "conductors": without(state.conductors, people),
                "let_in": without(state.let_in, people),
                "groups": groups.leaving(state.groups, people),
                "look": None if state.look in people else state.look,
            }
        )

    def with_names(self) -> State:
        """The state with the animals that people were called after since."""
        return self._named({})

    def _named(self, wanted: Mapping[str, object]) -> State:
        return self.state.model_copy(update={**wanted, "named": dict(self._numbers)})


def _thing(part: c.SimpleOp) -> str | None:
    """The stroke or layer that an op changes; None where it brings a new one."""
    if isinstance(part, c.BeginStroke | c.AddLayer | c.SetTerrain):
        return None
    return part.layer if isinstance(part, c.SetLayer | c.DeleteLayer | c.RestoreLayer) else part.stroke


def _sets_task(part: c.SimpleOp) -> bool:
    return isinstance(part, c.SetTerrain) and not TASK_FIELDS.isdisjoint(part.fields.model_fields_set)


def _signed(part: c.SimpleOp, name: str) -> c.SimpleOp:
    if isinstance(part, c.BeginStroke) and part.stroke.author:
        return part.model_copy(update={"stroke": part.stroke.model_copy(update={"author": name})})
    return part
