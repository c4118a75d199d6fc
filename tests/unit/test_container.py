"""The container files agree with the repository and with each other (SPEC H8); no engine is needed."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pytest
from tests.unit.test_docs import ROOT, files, text

from esker import cli, settings

DOCKERFILE = re.sub(r"\\\n", " ", text("Dockerfile"))


def instructions(word: str) -> list[list[str]]:
    """The arguments of every instruction of a kind, without its options."""
    found = re.findall(rf"^{word} (.*)$", DOCKERFILE, re.M)
    return [[part for part in shlex.split(line) if not part.startswith("--")] for line in found]


def ignored(path: str) -> bool:
    """Whether .dockerignore keeps a path out of the build: patterns begin at the root unless with **/."""
    for line in text(".dockerignore").splitlines():
        for folder in (path, *(str(above) for above in Path(path).parents)):
            deep = line.startswith("**/") and fnmatch(Path(folder).name, line.removeprefix("**/"))
            if deep or fnmatch(folder, line):
                return True
    return False


CONTEXT = [path for path in files() if not ignored(path)]
COPIED = [source for *sources, _ in instructions("COPY") for source in sources]


@pytest.mark.parametrize("source", [source for source in COPIED if not source.startswith("/")])
def test_what_is_copied_is_there_and_not_ignored(source: str) -> None:
    assert any(path == source or path.startswith(f"{source}/") for path in CONTEXT)


def test_secrets_and_what_is_built_stay_out() -> None:
    assert ignored(".git/config")
    assert ignored("frontend/node_modules/vite/package.json")
    assert ignored("data/journal.db")
    assert ignored("backend/esker/tiles/__pycache__/loops.pyc")
    assert not ignored("backend/esker/templates/data/puget.npz")


def test_all_that_the_page_imports_is_copied_before_it_is_built() -> None:
    """The first stage has no tests, backend nor documents: what the page's sources import must lie in what it has."""
    page = DOCKERFILE.split("FROM ")[1]
    assert "COPY shaders /esker/shaders" in page
    for path in (path for path in CONTEXT if path.startswith("frontend/src/") and path.endswith(".ts")):
        for name in re.findall(r'(?:from|import) "([.@][^"]*)"', text(path)):
            if name.startswith("@shaders/"):
                to = ROOT / "shaders" / name.removeprefix("@shaders/")
            elif name.startswith("."):
                to = (ROOT / path).parent / name
            else:
                continue
            inside = str(to.resolve().relative_to(ROOT)).partition("?")[0]
            assert inside.startswith(("frontend/src/", "shaders/")), f"{path} imports {name}"
            assert inside in CONTEXT, f"{path} imports {name}"


def test_the_command_is_one_that_the_server_takes() -> None:
    program, flag, package, *arguments = json.loads(DOCKERFILE.split("\nCMD ")[1])
    assert (program, flag, package) == ("python", "-m", "esker")
    parsed = cli._parser().parse_args(arguments)
    assert (parsed.host, parsed.port, str(parsed.data)) == ("0.0.0.0", 8000, "/data")
    assert instructions("EXPOSE") == [["8000"]]
    assert instructions("VOLUME") == [["/data"]]
    owner = re.search(r"chown (\w+):\w+ /data", DOCKERFILE)
    assert owner is not None
    assert instructions("USER") == [[owner.group(1)]]


def test_the_health_check_asks_for_a_page_that_is_there() -> None:
    """The page itself answers in tests/sync/test_access.py."""
    url = re.search(r"http://127\.0\.0\.1:8000(/\w+)", DOCKERFILE)
    assert url is not None
    assert f'@app.get("{url.group(1)}")' in text("backend/esker/server/page.py")


def test_compose_and_caddy_name_the_same_server() -> None:
    compose, caddy = text("docker-compose.yml"), text("Caddyfile")
    assert "reverse_proxy esker:8000" in caddy
    assert re.search(r"^  esker:\n    build: \.", compose, re.M)
    assert "./Caddyfile:/etc/caddy/Caddyfile:ro" in compose
    given = set(re.findall(r"^      ESKER_(\w+):", compose, re.M)) - {"DOMAIN"}
    assert given == {"PUBLIC_URL", "FORWARDED_ALLOW_IPS"}
    assert {name.lower() for name in given} <= vars(settings.Settings()).keys()


def test_versions_are_those_that_the_make_file_takes() -> None:
    images = dict(re.findall(r"^FROM (\w+):([\d.]+)", DOCKERFILE, re.M))
    assert int(images["node"]) >= 22
    least = tomllib.loads(text("pyproject.toml"))["project"]["requires-python"]
    assert f">={images['python']}" == least
