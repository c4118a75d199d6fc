"""The table of ``docs/security.md`` out of the committed result of ``esker bench siege``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

BEGIN: Final = "<!-- siege: written by `python -m bench.report` -->"
END: Final = "<!-- end of siege -->"
KEYS: Final = {"ack_p99_ms": "acknowledged, p99", "tile_p50_ms": "first tile, p50", "settling_s": "settled"}


def document(text: str, result: dict[str, Any]) -> str:
    """The page with its table renewed. Raises ValueError when the markers are missing."""
    if BEGIN not in text or END not in text:
        raise ValueError("docs/security.md has no place for the table")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    return f"{before}{BEGIN}\n\n{table(result)}\n\n{END}{after}"


def table(result: dict[str, Any]) -> str:
    """One line an attack: how many times as long things took, and the memory."""
    machine, alone, aims = result["machine"], result["runs"]["alone"], result["aims"]
    floor = ", ".join(f"{name} {alone['floor'].get(key, 1.0):.1f}" for key, name in KEYS.items())
    rows = [name for name in result["runs"] if name != "alone"]
    runs = [result["runs"][name] for name in rows]
    lines = [
        f"Measured on {machine['cores']} cores ({machine['cpu']}), load {machine['load_before']} before it began, "
        f"{result['scene']['seconds']:.0f} s of drawing beside each attack. {result['note']}".strip(),
        "",
        f"Without an attack ({alone['times_measured']} times, medians): acknowledged in {alone['ack_p99_ms']:.0f} ms "
        f"(p99), first tile in {alone['tile_p50_ms']:.0f} ms (p50), settled {alone['settling_s']:.2f} s after the last "
        f"change. The worst of these by the median: {floor}. {_read_against(result)}; **bold** where it is above the "
        f"aim:",
        *_beside(result["runs"]),
        "",
        f"| attack | {' | '.join(f'{name} (aim {aims[key]:.0f})' for key, name in KEYS.items())} | memory "
        f"(aim {aims['memory_mb']:,} MB) | afterwards |",
        "|---|---|---|---|---|---|",
        *(_line(name, result["runs"][name], aims) for name in rows),
        "",
        f"Of {len(rows)} rows {sum(_met(run, aims, _alone) for run in runs)} meet every aim by both, during the attack "
        f"and after it, and {sum(_met(run, aims, _times) > _met(run, aims, _alone) for run in runs)} more only by the "
        f"first; connections or changes of the people that were lost: "
        f"{sum(result['runs'][name]['closed'] + result['runs'][name]['unanswered'] for name in rows)}; tracebacks in "
        f"the log: {result['tracebacks']}.",
    ]
    return "\n".join(lines)


def _beside(runs: dict[str, Any]) -> list[str]:
    """Returns what is said of the disk, and of rows that were measured more than once."""
    disks = [run["disk"] for run in runs.values() if run.get("disk")]
    again = sum("measured" in run for run in runs.values())
    said = []
    if disks:
        said += [
            "",
            f"The disk by itself, which others use too: a page was written and synced in {disks[0]['p99_ms']:.0f} ms "
            f"(p99) without an attack, in {max(disk['worst_ms'] for disk in disks):.0f} ms at worst beside one. "
            + (
                f"{again} rows were measured three times, as they missed an aim: the middle stands here."
                if again
                else ""
            ),
        ]
    return said


def _read_against(result: dict[str, Any]) -> str:
    """Returns what the numbers of the table are times of."""
    if all("nothing" in run for name, run in result["runs"].items() if name != "alone"):
        return (
            "Beside each attack, times what the same people had beside a process that took as much of the processors "
            "and sent nothing, or without an attack, whichever is more (in brackets: times the latter)"
        )
    return "Beside each attack, times the median (again in brackets)"


def _above(key: str, times: dict[str, float], aims: dict[str, float]) -> bool:
    """Returns whether a figure is above its aim. What the machine does by itself is no excuse: that is why rows are
    measured three times."""
    return times.get(key, 0.0) > aims[key]


def _times(found: dict[str, Any]) -> dict[str, float]:
    """Returns how many times as long things took as beside a process that sends nothing."""
    times: dict[str, float] = found.get("times_beside_nothing", found.get("times_alone", {}))
    return times


def _alone(found: dict[str, Any]) -> dict[str, float]:
    """Returns how many times as long things took as without an attack."""
    times: dict[str, float] = found.get("times_alone", {})
    return times


def _met(run: dict[str, Any], aims: dict[str, float], of: Callable[[dict[str, Any]], dict[str, float]]) -> bool:
    both = of(run), of(run["after"])
    slow = any(_above(key, times, aims) for times in both for key in KEYS)
    return not slow and run["server"]["memory_mb"] <= aims["memory_mb"]


def _line(name: str, run: dict[str, Any], aims: dict[str, float]) -> str:
    def cell(key: str) -> str:
        alone = run["times_alone"].get(key, 0.0)
        text = f"{_times(run).get(key, 0.0):.1f}"
        text = f"**{text}**" if _above(key, _times(run), aims) else text
        return f"{text} ({alone:.1f})"

    memory = f"{run['server']['memory_mb']:,} MB"
    memory = f"**{memory}**" if run["server"]["memory_mb"] > aims["memory_mb"] else memory
    late = [
        f"{words} {_times(run['after'])[key]:.1f}"
        for key, words in KEYS.items()
        if _above(key, _times(run["after"]), aims)
    ]
    return f"| {name.replace('_', ' ')} | {' | '.join(map(cell, KEYS))} | {memory} | {', '.join(late) or 'as before'} |"
