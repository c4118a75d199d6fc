"""The benchmark of attacks notes what it should (SPEC P404)."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from bench.strangers import _siege_judged, siege
from bench.strangers._attacks import BY_LINK
from bench.strangers._siege_disk import Disk, summary
from tests.sync.harness import LiveServer


def figures(**over: Any) -> dict[str, Any]:
    usual = {"ack_p99_ms": 10.0, "tile_p50_ms": 40.0, "settling_s": 1.0, "closed": 0, "unanswered": 0}
    return usual | {"server": {"memory_mb": 500}} | over


def test_aims_that_do_not_hold_are_named() -> None:
    runs = {
        "alone": figures(),
        "fine": figures(ack_p99_ms=19.0, after=figures()),
        "slow": figures(ack_p99_ms=21.0, settling_s=2.9),
        "stays": figures(after=figures(tile_p50_ms=90.0)),
        "big": figures(server={"memory_mb": 3000}),
        "loses": figures(unanswered=2),
    }
    missed = _siege_judged.judged(runs)
    assert missed == {
        "slow": ["ack_p99_ms: 2.1 times, aim 2.0"],
        "stays": ["tile_p50_ms afterwards: 2.25 times, aim 2.0"],
        "big": ["memory: 3000 MB, aim 2147"],
        "loses": ["2 of the people's changes or connections were lost"],
    }
    assert runs["fine"]["after"]["times_alone"]["settling_s"] == 1.0


def test_the_machine_s_own_noise_is_measured() -> None:
    """SPEC P404: one measurement without an attack, on a busy machine, made every attack look good or bad."""
    found = _siege_judged.floor([figures(ack_p99_ms=ack) for ack in (10.0, 30.0, 12.0)])
    assert (found["ack_p99_ms"], found["times_measured"]) == (12.0, 3)
    assert found["floor"] == {"ack_p99_ms": 2.5, "tile_p50_ms": 1.0, "settling_s": 1.0}
    still = _siege_judged.floor([figures(settling_s=0.0)])
    assert "settling_s" not in still["floor"]


def test_a_row_is_read_against_a_process_that_sends_nothing() -> None:
    """SPEC P544: what as busy a process costs is the machine's doing, where it is more than without one."""
    runs = {
        "alone": figures(),
        "machine": figures(ack_p99_ms=39.0, nothing={"ack_p99_ms": 20.0, "tile_p50_ms": 30.0, "settling_s": 1.0}),
        "attack": figures(tile_p50_ms=90.0, nothing={"ack_p99_ms": 20.0, "tile_p50_ms": 30.0, "settling_s": 1.0}),
    }
    assert _siege_judged.judged(runs) == {"attack": ["tile_p50_ms: 2.25 times, aim 2.0"]}
    assert runs["machine"]["times_alone"]["ack_p99_ms"] == 3.9
    assert runs["machine"]["times_beside_nothing"]["ack_p99_ms"] == 1.95


def row(ack: float, tile: float, *, lost: int = 0, after: float = 10.0, worst: float = 2.0) -> dict[str, Any]:
    """A row as it is measured once."""
    nothing = {key: value for key, value in figures().items() if key in _siege_judged.TIMES}
    disk = {"p99_ms": 1.0, "worst_ms": worst}
    counts = {"acks": 100, "refused": 0, "unanswered": lost, "disk": disk, "nothing": nothing}
    later = nothing | {"ack_p99_ms": after, "memory_mb": 500, "disk": disk}
    return figures(ack_p99_ms=ack, tile_p50_ms=tile, after=later) | counts


def test_of_three_times_the_middle_counts_and_all_that_was_lost() -> None:
    """SPEC P667: the disk of a row stalled three times in fifteen seconds, whoever attacked."""
    found = _siege_judged.middle([row(90.0, 30.0, worst=300.0), row(15.0, 99.0, lost=1), row(16.0, 35.0, after=80.0)])
    assert (found["ack_p99_ms"], found["tile_p50_ms"]) == (16.0, 35.0)
    assert (found["acks"], found["unanswered"]) == (300, 1)
    assert found["disk"]["worst_ms"] == 300.0
    assert (found["after"]["ack_p99_ms"], found["after"]["memory_mb"]) == (10.0, 500)
    assert [one["ack_p99_ms"] for one in found["measured"]] == [90.0, 15.0, 16.0]
    runs = {"alone": figures(), "x": found}
    assert _siege_judged.judged(runs) == {"x": ["1 of the people's changes or connections were lost"]}


def test_what_only_another_stall_excuses_is_measured_again() -> None:
    """SPEC P667: a disk that stood still beside the attack, and beside the process that sends nothing too."""
    stalled = {"ack_p99_ms": 80.0, "tile_p50_ms": 40.0, "settling_s": 1.0}
    runs = {
        "alone": figures(),
        "fine": row(19.0, 40.0),
        "excused": row(70.0, 40.0) | {"nothing": stalled},
        "missed": row(70.0, 40.0),
    }
    assert _siege_judged.unsure(runs) == ["excused", "missed"]
    assert "times_alone" not in runs["fine"], "nothing is written into them yet"
    assert set(_siege_judged.judged(runs)) == {"missed"}


def test_what_misses_an_aim_is_measured_three_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P667: and nothing else is."""
    made: list[str] = []

    async def besieged(_: Any, names: list[str], *more: Any) -> dict[str, Any]:
        made.append(names[0])
        found = row(9e9 if names[0] == "codes" else 0.0, 0.0, after=0.0) | {"settling_s": 0.0}
        found["after"] |= {"tile_p50_ms": 0.0, "settling_s": 0.0}
        return found

    monkeypatch.setattr(siege, "_besieged", besieged)
    with LiveServer(tmp_path) as live:
        server = siege.Server(live.base, psutil.Process(), tmp_path)
        runs, _ = asyncio.run(siege._run(server, ["codes", "journal"], siege.Plan(0.5, 0.0, apart=True)))
    assert made == ["codes", "journal", "codes", "codes"]
    assert len(runs["codes by a stranger"]["measured"]) == 3


def test_the_disk_is_looked_at_meanwhile(tmp_path: Path) -> None:
    """SPEC P667."""
    with Disk(tmp_path / "probe") as disk:
        time.sleep(0.5)
        assert disk.figures()["p99_ms"] > 0
        assert (tmp_path / "probe").stat().st_size == 4096
    assert not (tmp_path / "probe").exists()
    assert summary([0.001] * 100 + [0.3]) == {"p99_ms": 1.0, "worst_ms": 300.0}
    assert summary([]) == {}


def test_a_result_is_put_together_from_pieces() -> None:
    """SPEC P544: newer rows take the place of older ones, misses too; the floor is the worst."""

    def piece(slow: float, worst: float) -> tuple[dict[str, Any], dict[str, list[str]]]:
        runs = {"alone": figures(floor={"ack_p99_ms": worst}, times_measured=1), "x": figures(ack_p99_ms=slow)}
        return runs, _siege_judged.judged(runs)

    runs, missed = piece(90.0, 3.0)
    runs |= {"y": figures(unanswered=1)}
    before = {"runs": runs, "missed": _siege_judged.judged(runs)}
    assert set(before["missed"]) == {"x", "y"}
    found, missed = _siege_judged.merged(before, *piece(11.0, 1.5))
    assert set(missed) == {"y"}
    assert found["x"]["ack_p99_ms"] == 11.0
    assert (found["alone"]["floor"]["ack_p99_ms"], found["alone"]["times_measured"]) == (3.0, 2)


def test_who_makes_an_attack() -> None:
    """SPEC P544: pupils those that need a pen, viewers those that need a link."""
    assert siege.roles("pupil") == ("pupil",)
    assert siege.roles("exports") == ("stranger", "viewer")
    assert siege.roles("copies") == ("stranger",)


def test_people_draw_what_is_taken_and_their_ground_settles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P404: each first change was refused, and what is refused was waited for as if it were on its way."""
    monkeypatch.setattr(siege, "_attack", lambda *_: None)
    with LiveServer(tmp_path) as live:
        server = siege.Server(live.base, psutil.Process(), tmp_path)
        plan = siege.Plan(1.0, 0.0)
        runs, left = asyncio.run(siege._run(server, [], plan))
    alone = runs["alone"]
    assert left == []
    assert alone["acks"] > 0
    assert (alone["refused"], alone["unanswered"], alone["closed"]) == (0, 0, 0)
    assert alone["settling_s"] < siege.SETTLED_SECONDS


def test_what_there_is_no_time_for_is_listed(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as live:
        server = siege.Server(live.base, psutil.Process(), tmp_path)
        runs, left = asyncio.run(siege._run(server, ["pings", "codes"], siege.Plan(1.0, 0.0, until=0.0)))
    assert set(runs) == {"alone"}
    assert left == [
        "pings by a stranger",
        "pings by a viewer",
        "codes by a stranger",
        "all by a stranger",
        "all by a viewer",
    ]
    assert set(siege.ATTACKS) >= BY_LINK


def test_time_is_kept_for_all_attacks_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P404: they come last, and are what a server has to stand."""

    async def besieged(*_: Any) -> dict[str, Any]:
        return row(0.0, 0.0, after=0.0)

    monkeypatch.setattr(siege, "_besieged", besieged)
    with LiveServer(tmp_path) as live:
        server = siege.Server(live.base, psutil.Process(), tmp_path)
        plan = siege.Plan(1.0, 0.0, until=time.monotonic() + 1_000, kept=2_000)
        runs, left = asyncio.run(siege._run(server, ["codes", "journal"], plan))
    assert left == ["codes by a stranger", "journal by a stranger"]
    assert set(runs) == {"alone", "all by a stranger", "all by a viewer"}
