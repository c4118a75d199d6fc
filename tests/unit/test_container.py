"""The container files agree with the repository and with each other (SPEC H8); no engine is needed."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import tomllib
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import pytest

from esker.cli import main
from esker.server import settings
from tests.unit.test_docs import ROOT, files, text

DOCKERFILE = re.sub(r"\\\n", " ", text("Dockerfile"))


def instructions(word: str) -> list[list[str]]:
    """The arguments of every instruction of a kind, without its options."""
    found = re.findall(rf"^{word} (.*)$", DOCKERFILE, re.M)
    return [[part for part in shlex.split(line) if not part.startswith("--")] for line in found]


IGNORED = text(".dockerignore").splitlines()


@cache
def is_named(path: str) -> bool:
    """Whether .dockerignore names a path itself: patterns begin at the root unless with **/."""
    name = Path(path).name
    return any(
        fnmatch(path, line) or (line.startswith("**/") and fnmatch(name, line.removeprefix("**/"))) for line in IGNORED
    )


def ignored(path: str) -> bool:
    """Whether .dockerignore keeps a path, or a folder that it lies in, out of the build."""
    return any(is_named(each) for each in (path, *(str(above) for above in Path(path).parents)))


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
    parsed = main._parser().parse_args(arguments)
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
    assert f'@app.get("{url.group(1)}")' in text("backend/esker/server/routes/health.py")


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


def service(name: str) -> str:
    """The lines of one service of docker-compose.yml."""
    found = re.search(rf"^  {name}:\n((?:    .*\n|\n)+)", text("docker-compose.yml"), re.M)
    assert found is not None
    return found.group(1)


@pytest.mark.parametrize("name", ["esker", "caddy"])
def test_containers_can_take_and_change_little(name: str) -> None:
    """SPEC H167."""
    lines = service(name)
    for line in ("read_only: true", "cap_drop: [ALL]", 'security_opt: ["no-new-privileges:true"]', "pids_limit: "):
        assert f"    {line}" in lines, line
    assert re.search(r"^    mem_limit: \S", lines, re.M)
    assert re.search(r"^      - /tmp:mode=1777,size=\d+[mg]$", lines, re.M)
    assert "logging:" in lines
    assert "privileged: true" not in lines
    assert re.findall(r"cap_add: .*", lines) == ([] if name == "esker" else ["cap_add: [NET_BIND_SERVICE]"])
    assert re.search(r"max-size: 10m, max-file: \"\d\"", service("esker")), "logs are turned over"


def test_what_is_compiled_is_kept_where_a_read_only_container_can_write() -> None:
    """SPEC H167: the caches of PoCL and of the loops."""
    given = dict(part.split("=", 1) for line in instructions("ENV") for part in line)
    (volume,) = instructions("VOLUME")[0]
    for name in ("XDG_CACHE_HOME", "NUMBA_CACHE_DIR"):
        assert given[name].startswith(f"{volume}/")


def test_packages_of_the_page_are_those_of_the_lock_file() -> None:
    """SPEC H167: `npm install` may change its mind, `npm ci` fails instead."""
    assert [line[-2:] for line in instructions("RUN")].count(["npm", "ci"]) == 1
    assert not [line for line in instructions("RUN") if line[:2] == ["npm", "install"]]


def test_no_compiler_nor_linker_comes_from_the_system() -> None:
    """What OpenCL kernels need for their build comes with the locked packages (DESIGN 17)."""
    (system,) = [line for line in instructions("RUN") if "apt-get" in line]
    assert not {"gcc", "clang", "binutils", "build-essential", "libc6-dev", "lld"}.intersection(system)


def test_images_get_the_digests_that_a_registry_says(tmp_path: Path) -> None:
    """SPEC H168: what the program writes over what stands in the files."""
    digest = "sha256:" + "0123456789abcdef" * 4
    names = ("Dockerfile", "docker-compose.yml", "docker-compose.cluster.yml")
    (tmp_path / "bin").mkdir()
    docker = tmp_path / "bin" / "docker"
    for file in names:
        shutil.copy(ROOT / file, tmp_path / file)

    def pin(*options: str) -> subprocess.CompletedProcess[str]:
        environment = {"ROOT": str(tmp_path), "PATH": f"{tmp_path / 'bin'}:/usr/bin:/bin"}
        command = ["/bin/bash", str(ROOT / ".ci" / "pin-images"), *options]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)

    before = "".join(text(file) for file in names)
    images = re.findall(r"^(?:FROM|    image:) ", before, re.M)
    docker.write_text("#!/bin/sh\necho 'no such host'\n")
    docker.chmod(0o755)
    assert pin().returncode == 1, "what is no digest is not written"
    assert (tmp_path / "Dockerfile").read_text() == text("Dockerfile")
    docker.write_text(f"#!/bin/sh\necho {digest}\n")
    for _ in range(2):  # once more replaces what is there
        assert pin().returncode == 0
        now = "".join((tmp_path / file).read_text() for file in names)
        assert now.count(f"@{digest}") == len(images) == 7
        assert re.sub(rf"@{digest}", "", now) == re.sub(r"@sha256:[0-9a-f]{64}", "", before)
    assert pin("--check").returncode == 0
    docker.unlink()
    (tmp_path / "Dockerfile").write_text(re.sub(r"@sha256:\w+", "", text("Dockerfile")))
    assert pin("--check").returncode == 1


def test_every_image_has_a_digest() -> None:
    """SPEC H560: one tag has one digest, in whatever file it stands."""
    files = ("Dockerfile", "docker-compose.yml", "docker-compose.cluster.yml")
    images = re.findall(r"^(?:FROM|    image:) (\S+)", "".join(text(file) for file in files), re.M)
    pinned = [re.fullmatch(r"([\w/.-]+:[\w.-]+)@(sha256:[0-9a-f]{64})", image) for image in images]
    assert len(images) == 7
    assert all(pinned), images
    digests = {found[1]: found[2] for found in pinned if found}
    assert all(found[2] == digests[found[1]] for found in pinned if found)
    assert len(set(digests.values())) == len(digests) == 5


def test_the_cluster_is_whole() -> None:
    """SPEC P597: what names what, as far as it can be known without an engine."""
    compose, caddy = text("docker-compose.cluster.yml"), text("Caddyfile.cluster")
    services = set(re.findall(r"^  ([\w-]+):$", compose.split("\nservices:\n")[1].split("\nvolumes:\n")[0], re.M))
    assert services == {"node-a", "node-b", "database", "blobs", "bucket", "caddy"}
    assert set(re.findall(r"(node-\w+):8000", caddy)) == {name for name in services if name.startswith("node-")}
    assert "./Caddyfile.cluster:/etc/caddy/Caddyfile:ro" in compose
    for name in ("a", "b"):
        block = re.search(rf"^  node-{name}:\n((?:    .*\n)+)", compose, re.M)
        assert block is not None
        assert f"ESKER_NODE: {name}\n" in block[1]
        assert f"ESKER_ADVERTISE: http://node-{name}:8000\n" in block[1]
        assert f"- node-{name}:/data\n" in block[1]
    given = set(re.findall(r"^ +ESKER_(\w+):", compose, re.M)) - {"DOMAIN"}
    assert {name.lower() for name in given} <= vars(settings.Settings()).keys()
    assert "@database/esker" in compose
    assert "-r requirements-cluster.lock" in DOCKERFILE, "the nodes have what they need for the database and the grids"
    assert "image: postgres:16" in compose
    volumes = set(re.findall(r"^  ([\w-]+):$", compose.split("\nvolumes:\n")[1], re.M))
    assert volumes == set(re.findall(r"^      - ([\w-]+):/", compose, re.M))
    asked = set(re.findall(r"\$\{(\w+):\?", compose))
    assert all(name in compose.split("x-contained")[0] for name in asked), "the head names what has to be set"


def test_caddy_asks_each_node_whether_people_should_be_sent_to_it() -> None:
    """SPEC P597, P588."""
    caddy = text("Caddyfile.cluster")
    assert "health_uri /readyz" in caddy
    assert '@app.get("/readyz")' in text("backend/esker/server/routes/health.py")
    assert "lb_policy header Esker-Terrain" in caddy
    assert "{query.terrain}" in caddy
    assert "/ws?terrain=" in text("frontend/src/app/session.ts")
