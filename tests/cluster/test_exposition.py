"""Figures as Prometheus reads them (SPEC P590)."""

from __future__ import annotations

import re

from esker.cluster.exposition import Family, Histogram, one, text

LINE = re.compile(r"^[a-zA-Z_:][a-zA-Z0-9_:]*(\{([a-z_]+=\"(\\.|[^\"\\\n])*\",?)*\})? (\+Inf|-?[0-9.e+-]+)$")


def test_labels_are_escaped() -> None:
    """SPEC P590."""
    written = text([Family("esker_node", "gauge", 'a\nb \\ "c"', {(("node", 'a"b\\c\nd'),): 1.5, (("node", "e"),): 2})])
    assert written == (
        '# HELP esker_node a\\nb \\\\ "c"\n# TYPE esker_node gauge\n'
        'esker_node{node="a\\"b\\\\c\\nd"} 1.5\nesker_node{node="e"} 2\n'
    )
    assert all(LINE.match(line) for line in written.splitlines() if line[0] != "#")


def test_a_histogram_counts_what_lies_below_each_bound() -> None:
    """SPEC P590."""
    found = Histogram((0.01, 0.1))
    for seconds in (0.001, 0.01, 0.05, 3.0):
        found.note(seconds)
    lines = text([Family("esker_ack_seconds", "histogram", "Acks.", found)]).splitlines()
    assert lines[2:] == [
        'esker_ack_seconds_bucket{le="0.01"} 2',
        'esker_ack_seconds_bucket{le="0.1"} 3',
        'esker_ack_seconds_bucket{le="+Inf"} 4',
        "esker_ack_seconds_sum 3.061",
        "esker_ack_seconds_count 4",
    ]
    assert all(LINE.match(line) for line in lines[2:])


def test_figures_without_labels() -> None:
    """SPEC P590."""
    assert text([one("esker_rooms", "gauge", "Rooms.", 2.0)]).splitlines()[-1] == "esker_rooms 2"
