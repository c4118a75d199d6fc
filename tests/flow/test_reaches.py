"""Rivers as lines (SPEC W14 to W21)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from esker.flow.reaches import NO_REACH, UNITS_PER_CELL, Reaches, bankfull, find_reaches, least_samples, simplify
from esker.flow.water import NO_SEA, find_water, quanta
from tests.flow.grounds import grounds
from tests.vectors.flow_cases import valleys

VECTORS = Path(__file__).parents[1] / "vectors" / "flow.json"
Ints = NDArray[np.int32]


def lines(reaches: Reaches) -> list[Ints]:
    return [reaches.points[reaches.start[k] : reaches.start[k + 1]] for k in range(len(reaches))]


def test_reaches_meet_where_they_run_into_each_other() -> None:
    """SPEC W14, W15: areas grow downstream, and every reach ends at the head of the next or leaves."""
    z = valleys()
    water = find_water(z)
    reaches = find_reaches(water, 4.0)
    found = lines(reaches)
    assert len(found) > 4
    least = least_samples(len(z) - 1, 4.0)
    for k, line in enumerate(found):
        head, last = reaches.samples[k]
        np.testing.assert_array_equal(line[0], [head % 41 * UNITS_PER_CELL, head // 41 * UNITS_PER_CELL])
        np.testing.assert_array_equal(line[-1], [last % 41 * UNITS_PER_CELL, last // 41 * UNITS_PER_CELL])
        assert least <= reaches.areas[k, 0] <= reaches.areas[k, 1] <= water.area.ravel()[last]
        following = reaches.next[k]
        if following == NO_REACH:
            assert water.receiver.ravel()[last] < 0
        else:
            assert following > k
            assert reaches.samples[following, 0] == last
            assert reaches.areas[following, 0] >= reaches.areas[k, 1]


def test_each_sample_of_the_network_is_on_one_reach() -> None:
    """SPEC W14, W17."""
    z = valleys()
    water = find_water(z)
    reaches = find_reaches(water, 4.0)
    receiver, area = water.receiver.ravel(), water.area.ravel()
    fallen = water.highest().ravel() - water.filled.ravel() >= len(z) - 1
    passed = np.zeros(z.size, int)
    for head, last in reaches.samples:
        at = int(head)
        while at != last:
            passed[at] += 1
            at = int(receiver[at])
    wet = (area >= least_samples(len(z) - 1, 4.0)) & (receiver >= 0) & fallen
    assert (passed[wet] == 1).all()
    assert (passed[~wet] == 0).all()


def test_more_rivers_are_asked_for_by_a_smaller_area() -> None:
    """SPEC W16."""
    water = find_water(valleys())
    counts = [len(find_reaches(water, many)) for many in (0.0, 0.5, 1.0, 4.0)]
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[1] < counts[3]
    assert least_samples(256, 1.0) == 256
    assert least_samples(1024, 1.0) == 16 * 256


@pytest.mark.parametrize("name", ["level all over", "sea over everything", "one sample", "one row", "two columns"])
def test_where_nothing_runs_there_is_no_river(name: str) -> None:
    """SPEC W17."""
    assert len(find_reaches(find_water(*grounds()[name]), 4.0)) == 0


def test_water_that_gathers_on_a_plain_is_no_river_until_it_has_come_down() -> None:
    """SPEC W17."""
    y, _ = np.mgrid[0:65, 0:65]
    plain = np.where(y > 32, 63, 0).astype(np.int32)  # a step that is lower than a 256th of the side
    assert len(find_reaches(find_water(plain), 4.0)) == 0
    assert len(find_reaches(find_water(plain * 4), 4.0)) > 0


def test_lines_stay_near_what_they_stand_for() -> None:
    """SPEC W18: within 0.35 of a cell of the smoothed way, which is within a cell of the samples."""
    water = find_water(valleys())
    reaches = find_reaches(water, 4.0)
    receiver = water.receiver.ravel()
    for k, line in enumerate(lines(reaches)):
        at, way = int(reaches.samples[k, 0]), []
        while at != reaches.samples[k, 1]:
            way.append((at % 41 * UNITS_PER_CELL, at // 41 * UNITS_PER_CELL))
            at = int(receiver[at])
        assert all(distance(np.array(p), line.astype(float)) <= 1.35 * UNITS_PER_CELL for p in way)


def distance(p: NDArray[np.float64], line: NDArray[np.float64]) -> float:
    a, b = line[:-1], line[1:]
    d = b - a
    t = np.clip(((p - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-9), 0, 1)
    return float(np.hypot(*(p - a - t[:, None] * d).T).min())


def test_simplifying_keeps_corners_and_drops_what_lies_on_lines() -> None:
    """SPEC W18."""
    corner = np.array([[0, 0], [16, 0], [32, 0], [32, 16], [32, 32]], np.int32)
    assert simplify(corner).tolist() == [True, False, True, False, True]
    bent = np.array([[0, 0], [160, 5], [320, 0]], np.int32)
    assert simplify(bent).tolist() == [True, False, True]
    bent[1, 1] = 6
    assert simplify(bent).all()
    there_and_back = np.array([[0, 0], [160, 0], [0, 0]], np.int32)
    assert simplify(there_and_back).all()
    assert simplify(np.array([[5, 5], [9, 9]], np.int32)).all()


def test_width_and_depth_follow_from_area_and_wetness() -> None:
    """SPEC W19."""
    width, depth = bankfull(np.array([0.0, 1e6, 16e6]))
    assert width[0] == 0
    assert width[1] == pytest.approx(2.70)
    assert depth[1] == pytest.approx(0.30)
    assert width[2] == pytest.approx(2.70 * 16**0.352)
    assert bankfull(np.array([1e6]), 16.0)[0][0] == pytest.approx(width[2])


def test_levels_have_the_same_rivers() -> None:
    """SPEC W20: least areas are shares of the domain, so a finer level has the same rivers, drawn more exactly."""
    n = 257
    y, x = np.mgrid[0:n, 0:n] / (n - 1)
    ground = (400 * y + 300 * np.abs(((x + 0.3 * y) * 4) % 1 - 0.5)).astype(np.float32)
    networks = []
    for step in (4, 1):
        cell = 1024 / (n - 1) * step
        reaches = find_reaches(find_water(quanta(ground[::step, ::step], cell)), 1.0)
        networks.append(reaches.points.astype(float) * (cell / UNITS_PER_CELL))
    coarse, fine = networks
    away = np.array([np.hypot(*(fine - p).T).min() for p in coarse])
    assert float(np.median(away)) < 16.0


def test_the_vectors_are_this_water() -> None:
    """SPEC W21: flow.json is what readers in other languages are held to."""
    for case in json.loads(VECTORS.read_text(encoding="utf-8"))["cases"]:
        z = np.array(case["ground"], np.int32).reshape(case["rows"], case["cols"])
        water = find_water(z, NO_SEA if case["sea"] is None else case["sea"])
        assert water.receiver.ravel().tolist() == case["receiver"]
        assert water.filled.ravel().tolist() == case["filled"]
        reaches = find_reaches(water, case["many"])
        assert [line.ravel().tolist() for line in lines(reaches)] == [reach["points"] for reach in case["reaches"]]
        assert reaches.next.tolist() == [reach["next"] for reach in case["reaches"]]
