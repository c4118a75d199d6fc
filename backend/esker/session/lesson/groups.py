"""Groups of people in a lesson, to whom pens are given together: values, without I/O (decision 76)."""

from __future__ import annotations

from collections.abc import Iterable

from esker import contract as c
from esker.contract import Grouping, PenGroup
from esker.session.lesson.state import with_people, without

Groups = tuple[PenGroup, ...]


def changed(groups: Groups, order: Grouping) -> Groups | c.NoticeCode:
    """The groups after an order about one of them, or about the pens of all; or the notice that says why it cannot be.

    An order about a group that is not there makes it where it says a name, and does nothing where it says none: a
    conductor may change what another one has just forgotten.
    """
    if order.group is None:
        return groups if order.pen is None else tuple(_with(each, {"pen": order.pen}) for each in groups)
    if order.forget:
        return tuple(each for each in groups if each.id != order.group)
    if all(each.id != order.group for each in groups):
        if order.name is None:
            return groups
        if len(groups) >= c.MAX_GROUPS:
            return "too_many_groups"
        groups = (*groups, PenGroup(id=order.group))
    put = frozenset(order.put)
    after = tuple(_ordered(each, order) if each.id == order.group else _left(each, put) for each in groups)
    return "too_many_grouped" if sum(len(each.people) for each in after) > c.MAX_GROUPED else after


def leaving(groups: Groups, people: Iterable[str]) -> Groups:
    """The groups without some people."""
    gone = frozenset(people)
    return tuple(_left(each, gone) for each in groups)


def pens(known: tuple[str, ...], before: Groups, after: Groups) -> tuple[str, ...]:
    """Who has a pen after groups were changed: whoever came into a group with pens has one, and whoever was in one and
    no longer is has none. Pens that were given or taken by hand stay as they are."""
    had, have = _with_pens(before), _with_pens(after)
    lost, got = tuple(each for each in had if each not in have), tuple(each for each in have if each not in had)
    return with_people(without(known, lost), got) if lost or got else known


def _with_pens(groups: Groups) -> dict[str, None]:
    """People of groups that have pens, in their order."""
    return dict.fromkeys(person for each in groups if each.pen for person in each.people)


def _ordered(group: PenGroup, order: Grouping) -> PenGroup:
    """The group that an order is about."""
    wanted: dict[str, object] = {"people": without(tuple(dict.fromkeys((*group.people, *order.put))), order.out)}
    if order.name is not None:
        wanted["name"] = order.name
    if order.pen is not None:
        wanted["pen"] = order.pen
    return _with(group, wanted)


def _left(group: PenGroup, people: frozenset[str]) -> PenGroup:
    """A group that people go out of."""
    if people.isdisjoint(group.people):
        return group
    return _with(group, {"people": tuple(each for each in group.people if each not in people)})


def _with(group: PenGroup, wanted: dict[str, object]) -> PenGroup:
    return group.model_copy(update=wanted)
