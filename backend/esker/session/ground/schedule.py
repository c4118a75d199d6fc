"""Turns of rooms on the solver (DESIGN 8): rooms that wait for a first coarse preview, finer previews, settling, and
refinement, in this order; in turn within each, a slice at a time. Finer previews are finished one after the other, and
so is settling, the smallest terrains first: interleaved, all of them would come late.

That order is among rooms that have had about as much time as each other. A room that has had ``AHEAD`` more than one
that waits comes behind it, for a coarsest preview ``AHEAD_COARSE`` more: however much work a room makes, it takes its
share and no more. Idle time is not saved up: a room that comes back begins level with those that are busy. Rooms of one
address share what one or two rooms have (``tally.py``).

A lower class that has waited for ``PATIENCE`` gets a slice all the same, the solve that was begun first, so nothing
starves. For coarse previews and refinement homes have turns first, then the rooms of one. A solve in progress holds
memory, so only so many may be in progress as fit the budget: a room that waits for its coarse preview ends the settling
solve that began last, which starts again later.

Channels that are made beside a solve have their turns like everything else, and are made to their end.

Everything here is a pure function of the grounds of all rooms, the time, and a tally of the time that they had.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from esker.grid import parked_bytes
from esker.process import memory
from esker.session.ground import states
from esker.session.ground.states import COARSE, FINER, REFINE, SETTLE, Ground, Previewing
from esker.session.ground.tally import PATIENCE, Room, Tally, Used

AHEAD: Final = 1.0
"""Seconds of the solver by which a room may be ahead of one that waits: what a stroke of some seconds takes. Whoever
was held back behind a shorter stroke kept the memory of a solve meanwhile."""
AHEAD_COARSE: Final = 2.0
"""Seconds by which it may be ahead with coarsest previews, if they take no longer than ``QUICK``: a stroke is seen as
it is drawn even where thirty rooms wait to settle. Who changes all the time comes to this bound once, and is held to
it."""
QUICK: Final = 0.05
BUDGET, BUDGET_SHARE = 1 << 30, 12
"""Bytes for solves in progress, of all rooms together."""


def default_budget() -> int:
    """Returns the bytes for solves in progress on this machine."""
    return min(BUDGET, memory.available_bytes() // BUDGET_SHARE)


Grounds = Mapping[Room, Ground]


def choose(grounds: Grounds[Room], now: float, tally: Tally[Room]) -> tuple[Room | None, Tally[Room]]:
    """Returns the room whose turn it is, None when there is nothing to do; and the tally after the choice."""
    staged, resting = _staged(grounds, now, tally)
    waiting = {room for stage, room in staged if stage != REFINE} or {room for _, room in staged}
    tally = tally.levelled(waiting | resting)  # who rests has not come back when it goes on
    if not staged:
        return None, tally
    rooms = tally.rooms
    level, nearly = tally.within(waiting, AHEAD), tally.within(waiting, AHEAD_COARSE)
    staged = [
        (stage, room)
        for stage, room in staged
        if room in (nearly if _is_quick(stage, grounds[room], rooms[room]) else level)
    ]
    stage, best = min(staged, key=lambda s: (s[0], *_order(s[0], grounds[s[1]], s[1], tally)))
    late = [(other, room) for other, room in staged if other > stage and now - rooms[room].ran_at > PATIENCE]
    if not late or now <= tally.favour.after:
        return best, replace(tally, favour=replace(tally.favour, room=None))
    best = _favoured(late, grounds, rooms)
    return best, replace(tally, favour=replace(tally.favour, room=best))


def _staged(grounds: Grounds[Room], now: float, tally: Tally[Room]) -> tuple[list[tuple[int, Room]], set[Room]]:
    """Returns the rooms that have something to do, each with its class, and those whose pass rests.

    None rests while another room waits, be it for memory: passes hold some. While one rests nothing is refined.
    """
    solving = _solving(grounds)
    classes = ((states.stage(ground, now), room) for room, ground in grounds.items())
    found = [(stage, room) for stage, room in classes if stage is not None]
    fitting = [(stage, room) for stage, room in found if _fits(room, stage, grounds, now, tally, solving)]
    resting = {room for stage, room in found if stage != COARSE and states.is_resting(grounds[room], now)}
    if not resting or any(room not in resting and stage != REFINE for stage, room in found):
        return fitting, set()
    return [], resting


def _is_quick(stage: int, ground: Ground, had: Used) -> bool:
    """Returns whether the room waits for a coarsest preview, and its last one was made in a moment."""
    return _is_coarsest(stage, ground) and had.time.coarsest_s <= QUICK


def _is_coarsest(stage: int | None, ground: Ground) -> bool:
    """Returns whether the room waits for a coarsest preview: channels have that class too, and may take long."""
    return stage == COARSE and not ground.channels.making and not states.starts_channels_beside(ground)


def _favoured(late: Sequence[tuple[int, Room]], grounds: Grounds[Room], rooms: Mapping[Room, Used]) -> Room:
    """Returns the room that has a slice out of turn: of the class and the size of the one that has had none for
    longest, the solve that was begun first. Slices that went round would finish none of them, and each would have its
    memory restored for every slice."""
    stage, longest = min(late, key=lambda found: rooms[found[1]].turn)
    if stage not in (FINER, SETTLE):
        return longest
    like = [room for other, room in late if other == stage and grounds[room].top == grounds[longest].top]
    return min(like, key=lambda room: rooms[room].began)


def rested_in(grounds: Grounds[Room], now: float) -> float | None:
    """Returns after how many seconds the first pass that rests goes on; None where none does."""
    ends = [states.rests_until(ground) for ground in grounds.values()]
    return min((end - now for end in ends if end > now), default=None)


def begin(
    room: Room, grounds: Grounds[Room], now: float, tally: Tally[Room]
) -> tuple[bool, Sequence[Room], Tally[Room]]:
    """Begins the slice of a room.

    Returns whether the room begins its newest job, and the rooms whose solves end for that.
    """
    ground = grounds[room]
    tally = replace(tally, turns=tally.turns + 1)
    time = replace(tally.rooms[room].time, is_coarsest=_is_coarsest(states.stage(ground, now), ground))
    tally = tally.noted(room, turn=tally.turns, ran_at=now, time=time).served(room)
    may = not ground.channels.making or _may_begin(room, COARSE, grounds, now, tally, _solving(grounds))
    if not states.starts(ground, now) or not may:
        return False, (), tally
    stage = states.stage(ground, now)
    gone = _in_the_way(room, COARSE if stage is None else stage, grounds, tally)
    for other in gone:
        tally = tally.noted(other, is_spared=True)
    spared = tally.rooms[room].is_spared
    if not states.needs_channels_only(ground):
        wanted, begun = ground.jobs.wanted, ground.jobs.begun
        spared = spared and wanted is not None and begun is not None and wanted.job.number == begun.job.number
    began = tally.rooms[room].began if states.is_overtaken(ground) else tally.turns  # it has waited long enough
    return True, gone, tally.noted(room, began=began, is_spared=spared)


def has_something_else(room: Room, grounds: Grounds[Room]) -> bool:
    """Returns whether there is anything to do but to go on with the room's solve."""
    return any(
        ground.jobs.wanted is not None
        or (other is not room and (states.is_solving(ground) or isinstance(ground.state, states.ChannelsOnly)))
        for other, ground in grounds.items()
    )


def _order(stage: int, ground: Ground, room: Room, tally: Tally[Room]) -> tuple[int, int]:
    """Returns a key by which rooms of one class are ordered: the least comes first.

    What was begun is finished before the next one of its class, since a room amid a solve holds memory. Where a slice
    is all that a room waits for, homes have turns before rooms have: else whoever is there waits once for each of
    sixty rooms that somebody opens.
    """
    had = tally.rooms[room]
    if stage in (FINER, SETTLE):
        return ground.top, had.began
    return tally.homes[tally.home_of(room)].turn, had.turn


# --- memory ---------------------------------------------------------------------------------------------------------


def bytes_of(ground: Ground) -> int:
    """Returns the memory that the room's solve holds between its turns, or would hold."""
    wanted, begun = ground.jobs.wanted, ground.jobs.begun
    open_ = states.is_solving(ground) or isinstance(ground.state, states.ChannelsOnly)
    attempt = begun if wanted is None or open_ else wanted
    return parked_bytes(ground.top, attempt is not None and attempt.job.base is not None)


def _fits(
    room: Room, stage: int, grounds: Grounds[Room], now: float, tally: Tally[Room], solving: Sequence[Room]
) -> bool:
    """Returns whether its slice may run."""
    return grounds[room].channels.making or _may_begin(room, stage, grounds, now, tally, solving)


def _may_begin(
    room: Room, stage: int, grounds: Grounds[Room], now: float, tally: Tally[Room], solving: Sequence[Room]
) -> bool:
    """Returns whether its newest job may be begun: in what memory there is, or in what others can leave."""
    ground = grounds[room]
    if states.is_solving(ground) or isinstance(ground.state, states.ChannelsOnly):
        return True
    if states.needs_channels_only(ground) or not states.starts(ground, now):
        return True
    held = [other for other in solving if other is not room]
    if _has_room(room, held, grounds, tally):
        return True
    settling = _settling(room, stage, grounds, tally, held)
    return _has_room(room, [other for other in held if other not in settling], grounds, tally)


def _settling(room: Room, stage: int, grounds: Grounds[Room], tally: Tally[Room], held: Sequence[Room]) -> list[Room]:
    """Returns those of ``held`` whose solves may end for the room's, longest first.

    ``held``: the others whose solves hold memory. Those may end that are only settling, have had no less time (for more
    than a coarse preview: too much) and were not ended before.
    """
    least = 0.0 if stage == COARSE else AHEAD
    found = [
        other
        for other in held
        if not isinstance(grounds[other].state, Previewing)
        and not tally.rooms[other].is_spared
        and tally.ahead(other, room) >= least
    ]
    return sorted(found, key=lambda other: grounds[other].shown.finest_at)


def _solving(grounds: Grounds[Room]) -> list[Room]:
    """Returns the rooms whose solves hold memory. They are few, and rooms are many, so they are found once a choice."""
    return [room for room, ground in grounds.items() if states.is_solving(ground)]


def _in_the_way(room: Room, stage: int, grounds: Grounds[Room], tally: Tally[Room]) -> Sequence[Room]:
    """Returns the fewest settling solves, last begun first, without which there is memory for the room's."""
    gone: list[Room] = []
    if states.needs_channels_only(grounds[room]):
        return gone
    held = [other for other in _solving(grounds) if other is not room]
    settling = _settling(room, stage, grounds, tally, held)
    while settling and not _has_room(room, held, grounds, tally):
        gone.append(settling.pop())
        held.remove(gone[-1])
    return gone


def _has_room(room: Room, held: Sequence[Room], grounds: Grounds[Room], tally: Tally[Room]) -> bool:
    return not held or sum(bytes_of(grounds[other]) for other in [*held, room]) <= tally.budget
