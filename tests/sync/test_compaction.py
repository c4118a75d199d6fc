"""Folding old gestures of a history: what it keeps, what it frees, and kills in between (SPEC J390 to J393)."""

from __future__ import annotations

import itertools
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from esker import contract as c
from esker.document.former import read_op
from esker.document.history.activity import ActivityLog, Entry, JournalEntry
from esker.document.history.folding import SILENT, Dated, fold
from esker.document.history.words import sentence
from esker.document.ops import StrokeSet
from esker.document.wire import op_json
from esker.session.room import core
from esker.session.room.history_view import HistoryReader
from esker.store.engine.ports import UsedTwice
from esker.store.journal import DamagedTerrain, Journal, Row
from esker.store.upkeep.compaction import Compaction
from tests.gestures import Done, session
from tests.store.engines import Store
from tests.sync.harness import LiveServer, set_op, stroke

BIRTH = c.Document(id="t")
LENGTH = 600
SNAPSHOTS = 120
OPENED_EVERY = {"sqlite": 5, "postgres": 20}
"""One of so many clocks is opened. What is folded is the same over each engine, which only hands out its rows."""


def _stored(journal: Journal, done: list[Done]) -> None:
    """Puts a session into a journal as a room does: a commit for each tick, a snapshot now and then."""
    for start in range(0, len(done), 3):
        tick = done[start : start + 3]
        journal._now = lambda at=tick[-1].at: at  # type: ignore[misc]
        last = tick[-1]
        due = start // SNAPSHOTS != (start + 3) // SNAPSHOTS
        journal.append("t", [each.row for each in tick]).result()
        if due:
            journal.keep_snapshot(last.after.to_document()).result()


def _folding(journal: Journal) -> Compaction:
    return Compaction(journal, lambda: 2e9, pause=lambda _: None)


@pytest.fixture
def journal(store: Store) -> Journal:
    """A journal over each engine."""
    made = store.open()
    made.create(BIRTH).result()
    return made


def _told(journal: Journal) -> list[Entry]:
    activity_log = ActivityLog(BIRTH)
    at = dict(journal.reader().execute("SELECT clock, at FROM moments WHERE terrain='t'").fetchall())
    time = None
    told = []
    clocks = iter(sorted(at))
    following = next(clocks, None)
    for row in journal.rows("t", 0):
        while following is not None and following <= row.clock:
            time, following = at[following], next(clocks, None)
        told.append(JournalEntry(row.clock, row.author, row.op, time))
    activity_log.add(told)
    return sorted(activity_log.entries, key=lambda entry: entry.last)


@pytest.mark.parametrize("seed", range(3))
def test_a_folded_history_makes_the_same_terrain(journal: Journal, seed: int, request: pytest.FixtureRequest) -> None:
    """SPEC J390: at every clock that lies in nobody's gesture; every clock opens; the list says the same."""
    done = session(seed, LENGTH, BIRTH)
    _stored(journal, done)
    now = done[-1].after
    before = _told(journal)
    said = [sentence(e, now.deleted | now.strokes, {}) for e in before]
    characters = sum(len(each.row.op) for each in done)
    gone = _folding(journal).terrain("t")
    rows = journal.rows("t", 0)
    assert gone == len(done) - len(rows) > len(done) / 3
    assert sum(len(row.op) for row in rows) < characters / 2
    loaded = journal.load("t")
    assert loaded is not None
    assert loaded.document.to_document() == now.to_document()
    assert loaded.counters == {person: max(d.row.counter for d in done if d.row.client == person) for person in
                               {d.row.client for d in done}}  # fmt: skip
    left = {row.clock for row in rows}
    folded = {d.row.clock: journal.find("t", d.row.client, d.row.counter) for d in done}
    assert all(clock is not None and clock in left and clock >= was for was, clock in folded.items())
    within = {k for was, clock in folded.items() for k in range(was, clock or 0)}
    for each in done[seed :: OPENED_EVERY[request.node.callspec.params["store"]]]:
        then = journal.document("t", each.row.clock)
        assert then is not None
        assert then.clock == each.row.clock
        if each.row.clock not in within:
            assert then.to_document() == each.after.to_document()
    after = _told(journal)
    assert [sentence(e, now.deleted | now.strokes, {}) for e in after] == said
    keys = [(e.last, e.author, e.action, e.subjects, e.turn) for e in after]
    assert keys == [(e.last, e.author, e.action, e.subjects, e.turn) for e in before]
    assert [round(e.at or 0) for e in after] == pytest.approx([round(e.at or 0) for e in before], abs=1)


def test_steps_through_a_folded_history_have_no_gap(journal: Journal) -> None:
    """SPEC J390: for who looks at the past and the time lapse."""
    done = session(1, 300, BIRTH)
    _stored(journal, done)
    _folding(journal).terrain("t")
    past = HistoryReader(journal, StrokeSet.from_document(BIRTH))
    clocks = iter(range(1, len(done) + 1))
    for clock in clocks:
        document, rows = past.go(clock)
        assert document.clock == clock
        assert [row.clock for row in rows or []] == [clock]
    assert document.to_document() == done[-1].after.to_document()
    for clock in (200, 3, 77, 299):
        assert past.go(clock)[0].clock == clock
    assert any(row.op == SILENT for row in journal.steps("t", 0))


def test_what_was_folded_is_used_once_and_missed_when_it_is_gone(journal: Journal) -> None:
    """SPEC J391: J1 and J6 hold for what was folded."""
    done = session(2, 400, BIRTH)
    _stored(journal, done)
    _folding(journal).terrain("t")
    left = {row.clock for row in journal.rows("t", 0)}
    gone = next(d.row for d in done if d.row.clock not in left)
    with pytest.raises(UsedTwice):
        journal.append("t", [gone._replace(client="new", counter=0)]).result()
    with pytest.raises(UsedTwice):
        journal.append("t", [gone._replace(clock=len(done) + 1)]).result()
    journal.append("t", [Row(len(done) + 1, "new", 0, "new", SILENT)]).result()
    kept = min(clock for clock in left if clock > 5)
    journal.submit(lambda db: db.execute("DELETE FROM ops WHERE clock=?", (kept,))).result()
    with pytest.raises(DamagedTerrain, match="were kept"):
        journal.load("t", kept + 1)


def test_only_what_is_old_and_behind_a_snapshot_is_folded(journal: Journal) -> None:
    """SPEC J390."""
    done = session(3, 300, BIRTH)
    _stored(journal, done)
    newest = journal.reader().execute("SELECT max(clock) FROM snapshots").fetchone()[0]
    end = done[-1].at
    young = Compaction(journal, lambda: end + 3600, fold_after=86_400.0, pause=lambda _: None)
    assert young.round() == 0
    half = done[150].at
    assert Compaction(journal, lambda: half + 100.0, fold_after=100.0, pause=lambda _: None).round() > 0
    stretches = journal.reader().execute("SELECT first, last FROM folds ORDER BY last").fetchall()
    assert stretches[-1][1] <= 151
    assert _folding(journal).round() > 0
    stretches = journal.reader().execute("SELECT first, last FROM folds ORDER BY last").fetchall()
    assert stretches[0][0] == 1
    assert stretches[-1][1] == newest < len(done)
    assert all(b[0] == a[1] + 1 for a, b in itertools.pairwise(stretches))
    assert [row.clock for row in journal.rows("t", newest)] == list(range(newest + 1, len(done) + 1))
    assert _folding(journal).round() == 0


def test_a_stretch_that_would_become_another_terrain_is_left(journal: Journal, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J390: it is compared before anything is written."""
    done = session(4, 300, BIRTH)
    _stored(journal, done)
    from esker.store.upkeep import compaction

    def wrong(history: list[Dated]) -> object:
        folded = fold(history)
        first = min(folded.into)
        return folded._replace(into={**folded.into, folded.into[first]: 10**6})

    monkeypatch.setattr(compaction, "fold", wrong)
    assert _folding(journal).terrain("t") == 0
    assert len(journal.rows("t", 0)) == len(done)
    assert journal.reader().execute("SELECT sum(kept - (last - first + 1)) FROM folds").fetchone()[0] == 0


def test_a_value_that_somebody_goes_back_to_stays(journal: Journal) -> None:
    """SPEC J390: the list tells an undo by it."""
    flank = [c.SetStroke(stroke="s", fields=c.StrokeFields(amplitude_m=float(v))) for v in (1, 2, 3, 4)]
    history = [Dated(k + 1, "a", "a", op, 100.0 + k / 10) for k, op in enumerate(flank)]
    assert fold(history).into == {1: 4, 2: 4, 3: 4}
    undo = Dated(5, "a", "a", flank[1], 110.0)
    assert fold([*history, undo]).into == {1: 2, 3: 4}
    other = Dated(5, "b", "b", flank[1], 110.0)
    assert fold([*history, other]).into == {1: 4, 2: 4, 3: 4}


def test_what_others_do_to_the_same_thing_ends_a_burst() -> None:
    ops: list[tuple[str, c.Op]] = [
        ("a", c.MoveAnchor(stroke="s", which="last", to=(1, 1, 1))),
        ("b", c.SetStroke(stroke="r", fields=c.StrokeFields(label="x"))),
        ("a", c.MoveAnchor(stroke="s", which="last", to=(2, 1, 1))),
        ("b", c.SetStroke(stroke="s", fields=c.StrokeFields(label="y"))),
        ("a", c.MoveAnchor(stroke="s", which="last", to=(3, 1, 1))),
        ("a", c.SetStroke(stroke="s", fields=c.StrokeFields(hidden=True))),
        ("a", c.SetStroke(stroke="s", fields=c.StrokeFields(hidden=False))),
    ]
    assert fold([Dated(k + 1, who, who, op, 100.0) for k, (who, op) in enumerate(ops)]).into == {1: 3}


def test_a_terrain_at_its_quota_gets_room_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J392: what is more than an hour old is folded at once where the history is half full."""
    monkeypatch.setattr(core, "SNAPSHOT_EVERY", 50)
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        journal = server.assembly._journal
        assert journal is not None
        journal._quota = 12_000
        peer = server.join(terrain, secret, "c1")
        peer.ops(("c1:0", stroke("s1")))
        refusal, counter = None, 0
        while refusal is None:
            counter += 1
            peer.ops((f"c1:{counter}", set_op("s1", amplitude_m=float(counter))))
            answer = peer.wait("ack", "reject")
            refusal = answer if answer["type"] == "reject" else None
        assert "Try again in a few minutes" in refusal["message"]
        assert counter > 50, "there is a snapshot"
        folding = Compaction(journal, lambda: 4e9, pause=lambda _: None)
        assert folding.terrain(terrain) > 40
        for k in range(20):
            peer.ops((f"c1:{counter + 1 + k}", set_op("s1", amplitude_m=float(k))))
            assert peer.wait("ack", "reject")["type"] == "ack"
        # An op whose acknowledgement was lost is not applied twice, though it is folded.
        peer.ops(("c1:7", set_op("s1", amplitude_m=7.0)))
        answer = peer.wait("ack", "reject")
        assert answer["ids"] == ["c1:7"]
        assert answer["clocks"][0] <= counter


def test_the_past_of_a_folded_history_over_the_wire(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC J390: steps forward come as ops, one for each clock."""
    monkeypatch.setattr(core, "SNAPSHOT_EVERY", 50)
    with LiveServer(tmp_path) as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret, "c1")
        peer.ops(("c1:0", stroke("s1")))
        for k in range(1, 60):
            peer.ops((f"c1:{k}", set_op("s1", amplitude_m=float(k))))
            peer.wait("ack")
        journal = server.assembly._journal
        assert journal is not None
        assert Compaction(journal, lambda: 4e9, pause=lambda _: None).terrain(terrain) > 40
        past = server.join(terrain, secret, "past", at=10)
        past.say("seek", clock=20)
        ops = past.wait("ordered")["ops"]
        assert [op["clock"] for op in ops] == list(range(11, 21))
        assert ops[-1]["op"] == json.loads(SILENT)
        for op in ops:
            c.OrderedOp.model_validate_json(json.dumps(op))
        status, page = server.http("GET", f"/api/terrains/{terrain}/history", secret=secret)
        assert status == 200
        assert len(page["entries"]) == 2


def test_moments_that_nobody_needs_go(journal: Journal) -> None:
    done = session(5, 300, BIRTH)
    _stored(journal, done)
    count = "SELECT count(*) FROM moments"
    before = journal.reader().execute(count).fetchone()[0]
    _folding(journal).terrain("t")
    assert journal.reader().execute(count).fetchone()[0] < before


def test_a_silent_operation_changes_nothing_but_the_clock() -> None:
    document = StrokeSet("t")
    after, dirty = document.apply(read_op(SILENT))
    assert dirty is None
    assert after.clock == 1
    assert after.settings == document.settings
    assert op_json(read_op(SILENT)) == SILENT


ROOT = Path(__file__).resolve().parents[2]
KILLS = 12
MOST_LIVES = 20 * KILLS
"""Lives after which the test gives up: kills did not strike where they were meant to."""
MOST_SAID = 6
LONGEST = 0.005
"""Seconds from what was said to the kill, at most: about as long as a stretch takes."""


def test_killed_while_folding(tmp_path: Path) -> None:
    """SPEC J393: each stretch is as it was or folded, and who writes meanwhile loses nothing."""
    done = session(7, 1_500, BIRTH)
    journal = Journal(tmp_path / "stored")
    for birth in (BIRTH, c.Document(id="u")):
        journal.create(birth).result()
    _stored(journal, done)
    journal.close()
    lives = folded = within = said = 0
    command = [sys.executable, "-m", "tests.sync.fold_child"]
    with subprocess.Popen(
        command, cwd=ROOT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as zygote:
        while lives < KILLS or min(folded, within) <= KILLS / 4 or said <= KILLS:
            assert lives < MOST_LIVES, (folded, within, said)
            data = shutil.copytree(tmp_path / "stored", tmp_path / str(lives))
            found = _folded_by_lives(zygote, data, done, lives)
            lives, folded, within, said = (a + b for a, b in zip((lives, folded, within, said), found, strict=True))
        assert zygote.stdin is not None
        zygote.stdin.close()


def _folded_by_lives(
    zygote: subprocess.Popen[str], data: Path, done: list[Done], seed: int
) -> tuple[int, int, int, int]:
    """Kills lives over one journal until it is folded.

    Returns how many there were, how many had folded something, how many were killed between the first stretch and the
    last, and how many ops were acknowledged meanwhile.
    """
    rng = random.Random(5 + seed)
    acked: set[int] = set()
    lives = folded = within = 0
    while lives < KILLS:
        lives += 1
        line = f"{data} {1_000_000 * lives}\n"
        said = _killed(zygote, line, rng.randint(1, MOST_SAID), rng.uniform(0, LONGEST))
        acked |= {int(word) for word in said if word.isdigit()}
        folded += "fold" in said
        is_within, is_whole = _as_it_was_or_folded(data, done, acked)
        within += is_within
        if is_whole:
            break
    journal = Journal(data)
    _folding(journal).terrain("t")
    loaded = journal.load("t")
    assert loaded is not None
    assert loaded.document.to_document() == done[-1].after.to_document()
    journal.close()
    return lives, folded, within, len(acked)


def _killed(zygote: subprocess.Popen[str], line: str, count: int, seconds: float) -> list[str]:
    """One life, killed so long after so many lines; what it said."""
    assert zygote.stdin is not None
    assert zygote.stdout is not None
    assert zygote.stderr is not None
    zygote.stdin.write(line)
    zygote.stdin.flush()
    child = int(zygote.stderr.readline())
    said = [zygote.stdout.readline().rstrip("\n") for _ in range(count)]
    assert "gone" not in said, "a life ended by itself: run tests/sync/fold_child.py to see why"
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    # The last line may be cut in two by the kill: then nobody has read it.
    while not (word := zygote.stdout.readline()).endswith("gone\n"):
        said.append(word.rstrip("\n"))
    return said


def _as_it_was_or_folded(data: Path, done: list[Done], acked: set[int]) -> tuple[bool, bool]:
    """Checks what a kill left; whether folding had begun and was not at its end, and whether it was."""
    journal = Journal(data)
    try:
        loaded = journal.load("t")
        assert loaded is not None
        assert loaded.document.to_document() == done[-1].after.to_document()
        steps = journal.steps("t", 0)
        assert [row.clock for row in steps] == list(range(1, len(done) + 1))
        left = {row.clock for row in journal.rows("t", 0)}
        for each in done:
            found = journal.find("t", each.row.client, each.row.counter)
            assert found in left, "an op was lost"
        assert acked <= {row.counter for row in journal.rows("u", 0)}
        newest = journal.reader().execute("SELECT max(clock) FROM snapshots WHERE terrain='t'").fetchone()[0]
        upto = journal.reader().execute("SELECT coalesce(max(last), 0) FROM folds").fetchone()[0]
        return 0 < upto < newest, upto == newest
    finally:
        journal.close()
