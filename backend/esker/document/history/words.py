"""What an entry says: "drew a mountain", "undid moving the plateau “Mesa”", "changed the look back"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from esker import contract as c
from esker.document.changes import TERRAIN_WORDS
from esker.document.history.activity import Action, Entry

_VERBS: Final[dict[Action, tuple[str, str]]] = {
    "draw": ("drew", "drawing"),
    "paint": ("painted", "painting"),
    "edit": ("changed", "changing"),
    "move": ("moved", "moving"),
    "reshape": ("reshaped", "reshaping"),
    "hide": ("hid", "hiding"),
    "show": ("showed", "showing"),
    "name": ("named", "naming"),
    "lock": ("locked", "locking"),
    "unlock": ("unlocked", "unlocking"),
    "delete": ("deleted", "deleting"),
    "restore": ("brought back", "bringing back"),
    "settings": ("changed", "changing"),
    "layer": ("added", "adding"),
    "order": ("reordered", "reordering"),
    "several": ("changed", "changing"),
}
_OPPOSITE: Final[dict[Action, Action]] = {"hide": "show", "show": "hide", "lock": "unlock", "unlock": "lock"}
"""The journal cannot tell a switch thrown back by hand from an undo: both are told as what became of the thing."""
_TURNED: Final[frozenset[Action]] = frozenset({"settings", "edit"})
"""A look, a rule or a flank is chosen back by hand as often as by undo, and the journal cannot tell which it was."""
MANY_WORDS: Final = 3
"""More settings than this are not listed."""


def sentence(entry: Entry, strokes: Mapping[str, c.Stroke], layers: Mapping[str, c.Layer]) -> str:
    """What was done, without the name of who did it.

    ``strokes``, ``layers``: those of the terrain now, deleted ones too; what is not among them any more has no name.
    """
    done, doing = _VERBS[entry.action]
    what = _settings(entry) if entry.action == "settings" else _things(entry, strokes, layers)
    if entry.turn and entry.action in _OPPOSITE:
        now = _OPPOSITE[entry.action] if entry.turn == "undo" else entry.action
        return f"{_VERBS[now][0]} {what} again"
    if entry.turn and entry.action in _TURNED:
        return f"{done} {what} {'back' if entry.turn == 'undo' else 'again'}"
    if entry.turn:
        return f"{'undid' if entry.turn == 'undo' else 'redid'} {doing} {what}"
    return f"{done} {what}"


def facts(entry: Entry, strokes: Mapping[str, c.Stroke], layers: Mapping[str, c.Layer]) -> dict[str, Any]:
    """Returns what the sentence is made of, for pages of another language (docs/decisions/0068-two-languages.md).

    ``noun``: what a single stroke is; ``label``: the name of a single stroke or layer; ``paint``: the channel of a
    paint stroke. They are empty where the terrain does not know the thing any more.
    """
    found: dict[str, Any] = {"kind": entry.kind, "count": len(entry.subjects), "noun": "", "label": "", "paint": ""}
    if entry.action == "settings":
        return found | {"fields": sorted(entry.fields)}
    if len(entry.subjects) == 1:
        stroke, layer = strokes.get(entry.subjects[0]), layers.get(entry.subjects[0])
        if stroke is not None:
            found |= {
                "noun": _noun(stroke),
                "label": stroke.label,
                "paint": stroke.paint.channel if stroke.paint else "",
            }
        elif layer is not None:
            found |= {"label": layer.name or layer.facts.file}
    return found


def _settings(entry: Entry) -> str:
    words = [word for name, word in TERRAIN_WORDS.items() if name in entry.fields]
    if len(words) == 2 and "direction of the sun" in words and "height of the sun" in words:
        return "the sun"
    if not words or len(words) > MANY_WORDS:
        return "the settings"
    return "the " + (words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}")


def _things(entry: Entry, strokes: Mapping[str, c.Stroke], layers: Mapping[str, c.Layer]) -> str:
    if entry.action == "several":
        return "several things"
    if len(entry.subjects) > 1:
        plural = {"stroke": "strokes", "layer": "layers"}.get(entry.kind, "things")
        return f"{len(entry.subjects)} {plural}"
    subject = entry.subjects[0]
    if entry.kind == "layer":
        return _layer(layers.get(subject), with_spacing=entry.action == "layer")
    return _stroke(strokes.get(subject), entry.action)


def _layer(layer: c.Layer | None, *, with_spacing: bool) -> str:
    if layer is None:
        return "a layer"
    name = layer.name or layer.facts.file
    words = f"layer {name}" if name else "a layer"
    return f"{words} ({_metres(max(layer.spacing_m))})" if with_spacing else words


def _metres(m: float) -> str:
    return f"{m:.3g} m"


def _stroke(stroke: c.Stroke | None, action: Action) -> str:
    if stroke is None:
        return "the ground" if action == "paint" else "a stroke"
    if stroke.paint is not None:
        return stroke.paint.channel if action == "paint" else f"a stroke of {stroke.paint.channel} paint"
    noun = _noun(stroke)
    if stroke.label:
        return f"the {noun} “{stroke.label}”"
    return f"a {noun}"


def _noun(stroke: c.Stroke) -> str:
    if stroke.course is not None:
        return stroke.course.use
    if stroke.kind == "level":
        return "plateau"
    return "crevice" if _sinks(stroke) else "mountain"


def _sinks(stroke: c.Stroke) -> bool:
    return sum(point[1] for point in stroke.curve) < 0
