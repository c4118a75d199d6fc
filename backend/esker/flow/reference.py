"""The plain twin of this room: the same rules in Python, sample by sample, for small grids.

It floods all samples where ``basins`` floods the graph of basins, and walks every drop to its end where ``area`` visits
each sample once.
"""

from __future__ import annotations

import heapq
from collections import deque
from itertools import pairwise

from esker.flow.receivers import DIAGONAL, OUT, STRAIGHT

Grid = list[list[int]]
MESH = ((0, 1), (0, -1), (1, 0), (-1, 0), (-1, 1), (1, -1))
"""Rows and columns to E W N S SE NW: the edges of the mesh."""
ACROSS = ((1, 1), (-1, -1))
"""NE SW."""


def steepest(z: Grid, sea: int) -> list[int]:
    """The receiver of each sample by descent alone."""
    rows, cols = len(z), len(z[0])
    out = []
    for r in range(rows):
        for c in range(cols):
            own = z[r][c]
            if r in (0, rows - 1) or c in (0, cols - 1) or own <= sea:
                out.append(OUT)
                continue
            best, at = 0, r * cols + c
            for k, (dr, dc) in enumerate(MESH + ACROSS):
                drop = (own - z[r + dr][c + dc]) * (STRAIGHT if k < 4 else DIAGONAL)
                crosses = k >= 6 and z[r + dr][c] + z[r][c + dc] >= 2 * own
                if drop > best and not crosses:
                    best, at = drop, (r + dr) * cols + c + dc
            out.append(at)
    return out


def receivers(z: Grid, sea: int) -> list[int]:
    """Where each sample runs to before basins run over; a pit's receiver is itself."""
    cols = len(z[0])
    down = steepest(z, sea)
    out = list(down)
    flat = [height for row in z for height in row]

    def level(i: int) -> list[int]:
        beside = [i + dr * cols + dc for dr, dc in MESH]
        return [j for j in beside if flat[j] == flat[i]]

    def spread(queue: deque[int]) -> None:
        while queue:
            i = queue.popleft()
            for j in level(i):
                if out[j] == j and j not in taken:
                    out[j] = i
                    taken.add(j)
                    queue.append(j)

    taken: set[int] = set()
    outlets: deque[int] = deque()
    for i, to in enumerate(down):
        ways = [j for j in level(i) if down[j] != j] if to == i else []
        if ways:
            out[i] = ways[0]
            taken.add(i)
            outlets.append(i)
    # An outlet is on no other's list: its receiver is not itself.
    order = deque(outlets)
    spread(order)
    for i in range(len(out)):
        if out[i] == i and i not in taken:
            taken.add(i)
            spread(deque([i]))
    return out


def basins(receiver: list[int]) -> list[int]:
    """The basin of each sample, 0 outside, by walking every drop."""
    pits = {i: k + 1 for k, i in enumerate(i for i, to in enumerate(receiver) if to == i)}
    out = []
    for i in range(len(receiver)):
        at = i
        while receiver[at] not in (OUT, at):
            at = receiver[at]
        out.append(pits.get(at, 0))
    return out


def flooded(z: Grid, sea: int) -> list[int]:
    """How high water or ground stands at each sample, by a flood of all samples."""
    rows, cols = len(z), len(z[0])
    flat = [height for row in z for height in row]
    out: list[int | None] = [None] * len(flat)
    heap: list[tuple[int, int]] = []
    for i, height in enumerate(flat):
        if i // cols in (0, rows - 1) or i % cols in (0, cols - 1) or height <= sea:
            out[i] = height
            heapq.heappush(heap, (height, i))
    while heap:
        water, i = heapq.heappop(heap)
        for dr, dc in MESH:
            r, c = i // cols + dr, i % cols + dc
            j = r * cols + c
            if 0 <= r < rows and 0 <= c < cols and out[j] is None:
                stands = out[j] = max(water, flat[j])
                heapq.heappush(heap, (stands, j))
    return [height for height in out if height is not None]


def exits(z: Grid, basin: list[int]) -> dict[int, tuple[int, int]]:
    """The samples on both sides of the pass over which each basin runs over, by Prim's flood over all passes."""
    rows, cols = len(z), len(z[0])
    flat = [height for row in z for height in row]
    passes: dict[tuple[int, int], tuple[int, int, int]] = {}
    for i, own in enumerate(basin):
        for dr, dc in MESH:
            r, c = i // cols + dr, i % cols + dc
            if not (0 <= r < rows and 0 <= c < cols) or basin[r * cols + c] <= own:
                continue
            j = r * cols + c
            found = (max(flat[i], flat[j]), min(i, j), max(i, j))
            pair = (own, basin[j])
            passes[pair] = min(passes.get(pair, found), found)
    around: dict[int, list[tuple[int, tuple[int, int, int]]]] = {}
    for (a, b), found in passes.items():
        around.setdefault(a, []).append((b, found))
        around.setdefault(b, []).append((a, found))
    out: dict[int, tuple[int, int]] = {}
    done: set[int] = set()
    heap = [(min(flat) - 1, 0, 0, 0)]
    while heap:
        water, low, high, b = heapq.heappop(heap)
        if b in done:
            continue
        done.add(b)
        if b != 0:
            out[b] = (low, high) if basin[low] == b else (high, low)
        for other, (height, p, q) in around.get(b, []):
            if other not in done:
                heapq.heappush(heap, (max(water, height), p, q, other))
    return out


def through(receiver: list[int], over: dict[int, tuple[int, int]]) -> list[int]:
    """Receivers once every basin runs over: the ways from its exit to its pit are turned round."""
    out = list(receiver)
    for inside, outside in over.values():
        way = [inside]
        while receiver[way[-1]] != way[-1]:
            way.append(receiver[way[-1]])
        for below, above in pairwise(way):
            out[above] = below
        out[inside] = outside
    return out


def areas(receiver: list[int]) -> list[int]:
    """How many drops pass each sample when one falls on every one."""
    out = [0] * len(receiver)
    for i in range(len(receiver)):
        at = i
        while at != OUT:
            out[at] += 1
            at = receiver[at]
    return out
