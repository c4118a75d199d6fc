"""What .ci/bare makes of the Dockerfile and its context (SPEC H169). Roots themselves are made before a release."""

from __future__ import annotations

import re
from pathlib import Path

from tests.unit.test_audit import ROOT, program

bare = program("bare")


def test_it_knows_every_instruction_of_the_dockerfile() -> None:
    read = list(bare.instructions((ROOT / "Dockerfile").read_text()))
    known = {"FROM", "WORKDIR", "ENV", "ARG", "EXPOSE", "VOLUME", "LABEL", "STOPSIGNAL", "USER", "COPY", "RUN", "CMD"}
    assert {word for word, _ in read} <= known | {"HEALTHCHECK"}
    assert next(rest for word, rest in read if word == "FROM").endswith(" AS page")
    assert next(rest for word, rest in read if word == "RUN" and "apt-get" in rest).count("\\") == 0, "one line"


def test_copy_takes_what_docker_takes(tmp_path: Path) -> None:
    context, root = tmp_path / "context", tmp_path / "root"
    (context / "backend/esker").mkdir(parents=True)
    (context / "backend/esker/a.py").write_text("a")
    for name in ("LICENSE", "NOTICE"):
        (context / name).write_text(name)
    root.mkdir()
    bare.copy("backend backend", context, {}, root, "/esker")
    bare.copy("LICENSE NOTICE ./", context, {}, root, "/esker")
    bare.copy("NOTICE /esker/deep/", context, {}, root, "/")
    bare.copy("--from=page /backend /elsewhere", tmp_path / "none", {"page": context}, root, "/")
    there = {path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()}
    assert there == {
        "esker/backend/esker/a.py", "esker/LICENSE", "esker/NOTICE", "esker/deep/NOTICE", "elsewhere/esker/a.py",
    }  # fmt: skip


def test_the_context_lacks_what_is_ignored(tmp_path: Path) -> None:
    (tmp_path / ".dockerignore").write_text((ROOT / ".dockerignore").read_text())
    for path in ("tests/a.py", "bench/b", ".git/config", "backend/esker/__pycache__/c.pyc", "backend/esker/d.py"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text("x")
    bare.without_ignored(tmp_path)
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert left == {".dockerignore", "backend/esker/d.py"}


def test_the_servers_environment_is_that_of_the_compose_file() -> None:
    assert bare.compose_environment(ROOT) == ["ESKER_FORWARDED_ALLOW_IPS=*"]


def test_the_release_page_has_a_place_for_the_log() -> None:
    page = (ROOT / "docs/releasing.md").read_text()
    assert page.index(bare.BEGIN) < page.index(bare.END)


def test_packages_of_the_system_are_installed_one_after_the_other() -> None:
    """SPEC H169: `make test` makes several targets at a time, and one apt-get holds the lock that the other wants."""
    makefile = (ROOT / "Makefile").read_text()
    assert re.search(r"-j\d \$\(STAMPS\)/dev browser", makefile)
    assert "apt-get" in makefile.split("$(VENV)/bin/python:\n")[1].split("\n\n")[0]
    assert re.search(r"^browser: \| \$\(VENV\)/bin/python\b", makefile, re.M)
