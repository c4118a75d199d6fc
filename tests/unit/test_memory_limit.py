"""The memory that a process may take is that of its control group, where it is in one (SPEC P227)."""

from __future__ import annotations

from pathlib import Path

import pytest

from esker.process import memory


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def test_without_groups_there_is_no_limit(tmp_path: Path) -> None:
    assert memory.limit_bytes(tmp_path, tmp_path / "none") is None
    write(tmp_path / "self", "0::/a/b\n")
    assert memory.limit_bytes(tmp_path, tmp_path / "self") is None


def test_the_least_of_a_group_and_those_above_it_counts(tmp_path: Path) -> None:
    write(tmp_path / "self", "0::/a/b\n")
    write(tmp_path / "a" / "b" / "memory.max", "max\n")
    assert memory.limit_bytes(tmp_path, tmp_path / "self") is None
    write(tmp_path / "a" / "memory.max", "2147483648\n")
    assert memory.limit_bytes(tmp_path, tmp_path / "self") == 2 << 30
    write(tmp_path / "a" / "b" / "memory.high", "1073741824\n")
    assert memory.limit_bytes(tmp_path, tmp_path / "self") == 1 << 30
    write(tmp_path.parent / "memory.max", "1\n")
    assert memory.limit_bytes(tmp_path, tmp_path / "self") == 1 << 30, "nothing above where they are mounted"


def test_the_first_version_too(tmp_path: Path) -> None:
    write(tmp_path / "self", "5:cpu,cpuacct:/x\n4:memory:/y\n")
    write(tmp_path / "memory" / "y" / "memory.limit_in_bytes", "536870912\n")
    write(tmp_path / "memory" / "memory.limit_in_bytes", "9223372036854771712\n")
    assert memory.limit_bytes(tmp_path, tmp_path / "self") == 512 << 20
    write(tmp_path / "memory" / "y" / "memory.limit_in_bytes", "9223372036854771712\n")
    assert memory.limit_bytes(tmp_path, tmp_path / "self") is None


def test_a_container_s_limit_is_what_is_available(monkeypatch: pytest.MonkeyPatch) -> None:
    memory.available_bytes.cache_clear()
    monkeypatch.setattr(memory, "limit_bytes", lambda: 123 << 20)
    assert memory.available_bytes() == 123 << 20
    memory.available_bytes.cache_clear()
