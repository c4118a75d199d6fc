"""What `esker bench synthesis` measures: its views are restricted trees, its cache forgets what was used least."""

from __future__ import annotations

import pytest

from bench.picture import synthesis as bench
from bench.room._slots import SlotMaker

HIGH = bench.Eye(700.0, 700.0, 200.0, 0.7)


def test_views_are_restricted_and_grow_with_what_they_ask() -> None:
    """Every tile's parent is there, with the parent's neighbours towards it; finer cells take more patches."""
    cuts = [bench.select(HIGH, px, 12) for px in (16.0, 8.0, 4.0)]
    assert [cut.patches for cut in cuts] == sorted({cut.patches for cut in cuts})
    for cut in cuts:
        for level, x, y in cut.tiles:
            assert level == 0 or (level - 1, x // 2, y // 2) in cut.tiles
    limit = bench.limit_for(HIGH, 300, 12)
    assert abs(bench.select(HIGH, limit, 12).patches - 300) < 30


def test_turned_away_nothing_is_asked() -> None:
    """Patches behind the eye are neither drawn nor split."""
    corner = bench.Eye(50.0, 50.0, 20.0, 0.7)
    assert bench.select(corner, 8.0, 12).patches > 3 * bench.select(corner._replace(yaw=0.7 + 3.14159), 8.0, 12).patches


def test_the_cache_forgets_the_least_recently_used_and_makes_only_what_is_missing() -> None:
    """A view twice costs nothing the second time; one that does not fit is refused."""
    maker = SlotMaker(bench.terrain(), 40)
    cache = bench.Cache(maker)
    near, far = bench.select(HIGH, 60.0, 12).tiles, bench.select(HIGH._replace(yaw=2.3), 60.0, 12).tiles
    first = cache.want(near)
    assert {(job.level, job.x, job.y) for job in first} == near
    assert cache.want(near) == []
    second = cache.want(far)
    assert {(job.level, job.x, job.y) for job in second} == far - near
    slots = [cache.slots[tile] for tile in cache.slots]
    assert len(set(slots)) == len(slots) <= 40
    with pytest.raises(RuntimeError, match="does not fit"):
        cache.want(bench.select(HIGH, 6.0, 12).tiles)


def test_figures_of_a_small_view_and_flight() -> None:
    """All figures come out, and tiles are made only where the eye goes."""
    maker = SlotMaker(bench.terrain(), 300)
    view = bench.view(maker, HIGH, 60, 1)
    assert view["tiles"] > 10
    assert view["ms"]["least"] > 0
    flight = bench.flight(maker, view["pixels_a_cell"], 4)
    assert flight["frames"] == 3
    assert flight["tiles_made"]["most"] < view["tiles"]
    assert bench.copy_rate(maker, 1) > 1e7


def test_agreement_tells_how_far_two_adapters_are_apart() -> None:
    """An adapter agrees with itself to the bit; a changed d shows."""
    own = bench.states(None)
    assert len(own) == 13
    assert bench.agreement(own, bench.states(None)) == {"detail_m": 0, "channel_units": 0, "equal_details": 1}
    other = [*own[:-1], own[-1]._replace(d=own[-1].d + 0.5, snow=own[-1].snow + 2 / 65535)]
    assert bench.agreement(other, own) == {"detail_m": 0.5, "channel_units": 2, "equal_details": round(12 / 13, 4)}
