"""What strangers and pupils do with classes, walls, switches, courses and maps in ``esker bench siege``."""

from __future__ import annotations

import asyncio
import json
import secrets
from contextlib import suppress
from typing import Any, Final

from bench.strangers._attacks import Attack, Target, _close, _drain, _heavy, _hello, _http, _made, _many, _member, frame
from bench.strangers._attacks import _pump as pump
from bench.strangers._attacks import _socket as open_socket
from esker import contract as c

COPIES: Final = 12
"""Copies of a class whose teacher attacks."""
OWNERS: Final = 40
"""Pages of one owner that switch a lesson at once."""


async def _class(at: Target, data: bytes | None = None, copies: int = COPIES) -> tuple[str, str, dict[str, Any]] | None:
    """A terrain of one's own, its secret, and a class of it with so many copies."""
    if data is None:
        status, made = await _http(at, "POST", "/api/terrains", b"{}")
        found = (made["id"], made["secret"]) if status == 201 else None
    else:
        found = await _made(at, data)
    if found is None:
        return None
    status, lesson = await _http(at, "POST", f"/api/terrains/{found[0]}/classes", b'{"places":60}', found[1])
    if status != 201:
        return None
    for _ in range(copies):
        await _sit(at, lesson)
    return *found, lesson


async def _sit(at: Target, lesson: dict[str, Any]) -> None:
    body = json.dumps({"code": lesson["code"], "seat": secrets.token_urlsafe(24), "name": "x" * 80}).encode()
    await _http(at, "POST", f"/api/classes/{lesson['id']}/seats", body)


async def copies(at: Target) -> int:
    """Seats in a class on a terrain of thousands of strokes: each is a copy of it."""
    made = await _class(at, await asyncio.to_thread(_heavy, 2_000, 50), 0)
    return 0 if made is None else await _many(at, lambda: _sit(at, made[2]), 60)


async def orders(at: Target) -> int:
    """What a teacher does to all copies, everything at once."""
    made = await _class(at, await asyncio.to_thread(_heavy, 1_000, 8))
    if made is None:
        return 0
    path = f"/api/terrains/{made[0]}/classes/{made[2]['id']}"
    asked: tuple[tuple[str, Any], ...] = (
        ("restart", {}),
        ("push", {}),
        ("together", {"numbers": list(range(1, COPIES + 1))}),
        ("show", {"number": 1}),
        ("open", {"number": 1}),
        ("collections", {}),
        ("freeze", {"frozen": True}),
    )

    async def order() -> None:
        what, body = secrets.choice(asked)
        await _http(at, "POST", f"{path}/{what}", json.dumps(body).encode(), made[1])

    return await _many(at, order, 100_000)


async def walls(at: Target) -> int:
    """Walls of a class that nobody reads, as many as open."""
    made = await _class(at)
    if made is None:
        return 0
    terrain, secret, lesson = made
    hello = {
        "type": "wall",
        "protocol": c.PROTOCOL_VERSION,
        "terrain": terrain,
        "secret": secret,
        "lesson": lesson["id"],
    }
    held: list[asyncio.StreamWriter] = []

    async def wall() -> None:
        reader, writer = await open_socket(at, "/ws/wall")
        writer.write(frame(json.dumps(hello).encode()))
        held.append(writer)
        await asyncio.wait_for(reader.read(1), 5)

    try:
        return await _many(at, wall, 10_000)
    finally:
        _close(held)


async def switches(at: Target) -> int:
    """Forty pages of an owner switch a lesson that hides names and remembers thousands of people."""
    status, made = await _http(at, "POST", "/api/terrains", b"{}")
    if status != 201:
        return 0
    people = [[f"{k:05}-{n:034}" for n in range(200)] for k in range(5)]
    texts = [
        {"type": "people", "action": action, "people": some}
        for action in ("pen", "let_in", "conductor")
        for some in people
    ]
    texts += [{"type": "grouping", "group": f"g{k}", "name": "", "put": people[k % 2]} for k in range(24)]
    first = b"".join(frame(json.dumps(text).encode()) for text in texts)
    flood = b"".join(
        frame(json.dumps(text).encode())
        for k in range(5)
        for text in (
            {"type": "conduct", "hands_off": k % 2 == 0, "hide": True, "animals": "en"},
            {"type": "grouping", "group": f"g{k}", "pen": True, "put": people[k % 2]},
            {"type": "rename", "name": f"{k}" * 80},
            {"type": "presence", "cursor": [k, 1, 2]},
        )
    )

    async def page() -> int:
        return await _slowly(at, _hello(made["id"], made["secret"]) + first, flood)

    return sum(await asyncio.gather(*(page() for _ in range(OWNERS))))


async def _slowly(at: Target, opening: bytes, payload: bytes) -> int:
    """Sends ``payload`` as often as rates allow, so that the connection lives."""
    count = 0
    while not at.over:
        with suppress(OSError, TimeoutError, asyncio.IncompleteReadError):
            reader, writer = await open_socket(at)
            reading = asyncio.create_task(_drain(reader, at))
            try:
                writer.write(opening)
                while not at.over and not reading.done():
                    writer.write(payload)
                    count += 1
                    await asyncio.wait_for(writer.drain(), 5)
                    await asyncio.sleep(0.05)
            finally:
                reading.cancel()
                writer.close()
        await asyncio.sleep(0.01)
    return count


async def pupil(at: Target) -> int:
    """Somebody whose pen was taken away draws, switches and renames all the same."""
    client = secrets.token_hex(8)
    stroke = {"id": "s", "kind": "profile", "first": [9, 9, 0], "last": [99, 9, 0], "curve": [[0, 9]] * 200}
    ops = [
        {"id": f"{client}:{k}", "op": {"type": "stroke.begin", "stroke": stroke | {"id": f"s{k}"}}} for k in range(8)
    ]
    texts: list[dict[str, Any]] = [
        {"type": "ops", "ops": ops},
        {"type": "conduct", "hands_off": False},
        {"type": "people", "action": "undo", "people": ["-"]},
        {"type": "grouping", "pen": True},
        {"type": "rename", "name": "x" * 80},
        {"type": "presence", "cursor": [1, 2, 3]},
    ]
    payload = b"".join(frame(json.dumps(text).encode()) for text in texts)
    return await pump(at, _hello(at.terrain, at.viewer, {"client": client}), payload)


async def exports(at: Target) -> int:
    """Maps and solids, with every number at an end of its range, and the largest of other files."""
    asked: tuple[dict[str, Any], ...] = (
        {"format": "map_pdf", "samples": 2049, "paper": {"size": "a3", "interval_m": 1e-300}},
        {"format": "map_svg", "samples": 2049, "paper": {"size": "a3", "scale": 1}},
        {"format": "map_svg", "samples": 1009, "paper": {"size": "a4", "scale": 50_000_000, "interval_m": 0.01}},
        {"format": "stl", "samples": 1025, "model": {"width_mm": 2000, "base_mm": 0.2, "exaggeration": 20}},
        {"format": "masks", "samples": 4097, "weights": True},
        {"format": "png16", "samples": 4097, "detail": False},
    )

    async def ask() -> None:
        path = secrets.choice(("exports", "exports/estimate"))
        body = json.dumps(secrets.choice(asked)).encode()
        await _http(at, "POST", f"/api/terrains/{at.terrain}/{path}", body, at.viewer)

    return await _many(at, ask, 100_000)


async def rivers(at: Target) -> int:
    """Terrains of one's own with courses of as many points as there may be, whose rivers are looked for on and on."""
    held: list[asyncio.StreamWriter] = []
    points = [[n / (c.MAX_COURSE_POINTS - 1), 0.3 * (n % 3)] for n in range(c.MAX_COURSE_POINTS)]
    course = {"use": "river", "rises": [-0.1 * n for n in range(c.MAX_COURSE_POINTS)]}

    async def one() -> None:
        status, made = await _http(at, "POST", "/api/terrains", b"{}")
        if status != 201:
            await asyncio.sleep(0.05)
            return
        reader, writer = await _member(at, made["id"], made["secret"], {"client": "c"})
        held.append(writer)
        ops = [
            {"id": f"c:{k}", "op": {"type": "stroke.begin", "stroke": {
                "id": f"s{k}", "kind": "course", "first": [100, 100 + 400 * k, 900], "last": [3900, 200 + 400 * k, 0],
                "curve": points, "course": course, "finished": True}}}
            for k in range(8)
        ]  # fmt: skip
        for op in ops:
            writer.write(frame(json.dumps({"type": "ops", "ops": [op]}).encode()))
        asyncio.get_running_loop().create_task(_drain(reader, at))
        for k in range(8, 200):
            if at.over:
                return
            op = {"id": f"c:{k}", "op": {"type": "terrain.set", "fields": {"rivers": c.MAX_RIVERS - 0.01 * (k % 50)}}}
            writer.write(frame(json.dumps({"type": "ops", "ops": [op]}).encode()))
            await asyncio.sleep(0.1)

    try:
        return await _many(at, one, 60, 16)
    finally:
        _close(held)


LESSON_ATTACKS: Final[dict[str, Attack]] = {
    attack.__name__: attack for attack in (copies, orders, walls, switches, pupil, exports, rivers)
}
BY_PUPIL: Final = frozenset({"pupil"})
"""Attacks by whoever has a link to draw and no pen."""
