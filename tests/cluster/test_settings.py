"""What a node has to be told, in sentences (SPEC P589), and what it gives out (SPEC P588, P590)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from esker.cli import main
from esker.server import nodes
from esker.server.settings import Settings
from esker.server.starting import CannotServe
from tests.sync.harness import LiveServer, stroke

WHOLE = Settings(
    database="postgresql://esker@db/esker", node="a", advertise="http://10.0.0.1:8000", cluster_key="k" * 32
)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"database": ""}, "ESKER_DATABASE=postgresql://"),
        ({"node": "a b"}, "--node"),
        ({"node": "x" * 41}, "--node"),
        ({"advertise": ""}, "--advertise"),
        ({"advertise": "10.0.0.1:8000"}, "--advertise"),
        ({"advertise": "http://10.0.0.1:8000/esker"}, "--advertise"),
        ({"cluster_key": "short"}, "ESKER_CLUSTER_KEY"),
    ],
)
def test_a_node_that_is_not_told_all_says_what_is_missing(wrong: dict[str, Any], said: str) -> None:
    """SPEC P589."""
    nodes.check(WHOLE)
    with pytest.raises(CannotServe, match=said):
        nodes.check(replace(WHOLE, **wrong))


def test_a_node_without_a_database_ends_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """SPEC P589: by the command, and nothing was made."""
    monkeypatch.delenv("ESKER_DATABASE", raising=False)
    data = tmp_path / "data"
    command = ["serve", "--node", "a", "--advertise", "http://127.0.0.1:1", "--port", "0", "--data", str(data)]
    assert main.main(command) == 1
    assert "ESKER_DATABASE=postgresql://" in capsys.readouterr().err
    assert not (data / "esker.db").exists()


def test_secrets_of_a_node_stand_in_no_text_of_its_settings() -> None:
    """SPEC P64."""
    assert "k" * 32 not in repr(WHOLE)
    assert "postgresql" not in repr(WHOLE)


def test_figures_are_given_to_whom_the_settings_name(tmp_path: Path) -> None:
    """SPEC P590: to nobody by default."""
    with LiveServer(tmp_path / "shut") as server:
        assert server.http("GET", "/metrics")[0] == 404
        assert "node" not in server.http("GET", "/healthz")[1]
    with LiveServer(tmp_path / "elsewhere", metrics="192.0.2.0/24") as server:
        assert server.http("GET", "/metrics")[0] == 404
    with LiveServer(tmp_path / "open", metrics="127.0.0.1") as server:
        terrain, secret = server.create()
        peer = server.join(terrain, secret)
        peer.ops(("c1:0", stroke()))
        peer.wait("ack")
        text = server.raw("GET", "/metrics")[1].decode()
        assert "esker_rooms 1\n" in text
        assert "esker_members 1\n" in text
        assert "esker_ack_seconds_count 1\n" in text
        assert "esker_leases" not in text
        assert terrain not in text
        peer.close()
