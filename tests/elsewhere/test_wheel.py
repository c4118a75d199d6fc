"""One wheel: built, installed into an empty environment, served from another folder (SPEC H163 to H165)."""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import urllib.error
import urllib.request
import zipfile
from pathlib import Path

import pytest
from PIL import Image

from esker import Stroke, connect, resources
from esker.process import system
from esker.render.pictures import previews
from tests.elsewhere.test_elsewhere import private_link

ROOT = Path(__file__).resolve().parents[2]
TAKEN = ("backend", "shaders", "frontend/dist", "bench/scenes")
FILES = ("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE", "NOTICE")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout, with the page that is built; made from a copy, so that nothing is left here."""
    assert (ROOT / "frontend/dist/index.html").is_file(), "make frontend/dist/index.html"
    copy, out = tmp_path_factory.mktemp("sources"), tmp_path_factory.mktemp("wheel")
    for folder in TAKEN:
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    for file in FILES:
        shutil.copy(ROOT / file, copy / file)
    _run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-index", "--no-build-isolation", "-w", out, copy)
    (made,) = out.iterdir()
    return made


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of an environment with the wheel, and with the packages that it needs from the present one."""
    folder = tmp_path_factory.mktemp("environment")
    _run(sys.executable, "-m", "venv", "--without-pip", folder)
    paths = {"base": str(folder), "platbase": str(folder)}
    found = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    _run(sys.executable, "-m", "pip", "--python", found, "install", "-q", "--no-deps", "--no-index", wheel)
    # Packages are found there. The line that makes the checkout importable is not: it is read in own folders only.
    (Path(sysconfig.get_path("purelib", vars=paths)) / "packages.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return found


def _run(*command: str | Path) -> str:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, env=_clean(), check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def _clean() -> dict[str, str]:
    # Loops would be compiled once more for this environment; what they do is not what is asked here.
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "ESKER_"))}
    return kept | {"NUMBA_DISABLE_JIT": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}


def test_the_wheel_holds_the_page_the_shaders_the_scenes_and_the_licences(wheel: Path) -> None:
    """SPEC H163."""
    assert wheel.name.endswith("-py3-none-any.whl"), "one wheel for all systems"
    with zipfile.ZipFile(wheel) as archive:
        there = set(archive.namelist())
    for folder, name in ((resources.SHADERS, "shaders"), (resources.PAGE, "page"), (resources.SCENES, "scenes")):
        beside = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
        assert beside
        assert {f"esker/files/{name}/{path}" for path in beside} <= there
    package = ROOT / "backend/esker"
    data = {
        path.relative_to(package.parent).as_posix() for path in (package / "templates").rglob("*") if path.is_file()
    }
    assert {path for path in data if "__pycache__" not in path} <= there
    assert {"LICENSE", "NOTICE"} <= {path.rpartition("/licenses/")[2] for path in there}
    assert "esker/files/page/licences.txt" in there
    assert not [path for path in there if path.startswith("tests") or path.endswith(".pyc")]


@pytest.mark.timeout(1200)
def test_an_environment_with_the_wheel_serves_from_any_folder(python: Path, tmp_path: Path) -> None:
    """SPEC H164."""
    where = "from esker import resources; print(resources.__file__, resources.CHECKOUT)"
    assert _run(python, "-c", where).split()[1] == "None", "this is the checkout, not the wheel"
    esker = python.with_name("esker.exe" if os.name == "nt" else "esker")
    command = [str(esker), "serve", "--port", "0", "--level", "0", "--refine", "0"]
    with subprocess.Popen(
        command, cwd=tmp_path, env=_clean(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert any("esker link" in line for line in process.stdout), process.stderr and process.stderr.read()
            link = private_link(tmp_path / "data")
            _page(link.partition("/t/")[0])
            with connect(link, ground=True) as t:
                t.set_terrain(rivers=0, erosion=0)  # their loops are not compiled here: in Python they take long
                ridge = [(800.0, 2000.0, 0.0), (2000.0, 2200.0, 600.0), (3200.0, 2000.0, 0.0)]
                t.add(Stroke.profile(ridge, left=(40, 900), right=(40, 900)))
                t.wait()
                t.ground.wait(120, quiet=5.0)  # beside other tests a first tile may be a while in coming
                assert t.ground.heights(0).max() > 200
            _picture(link)
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=60)
            assert process.returncode == 0, errors
            assert (tmp_path / "data" / "esker.db").is_file(), "data lie where it was started"
        finally:
            process.kill()


def _page(base: str) -> None:
    """The page, its modules as what browsers run, and a card of a starting terrain."""
    html = urllib.request.urlopen(base, timeout=30).read().decode()
    assets = set(re.findall(r'(?:src|href)="(/assets/[^"]+)"', html))
    assert any(path.endswith(".js") for path in assets)
    for path in sorted(assets | {"/templates/figure-six.webp", "/licences.txt"}):
        with urllib.request.urlopen(base + path, timeout=30) as answer:
            assert answer.headers["Content-Type"].partition(";")[0] == system.TYPES[Path(path).suffix]
            assert len(answer.read()) > 100


def _picture(link: str) -> None:
    """The preview of a link, which needs the shaders, and EGL: where there is none the server says so."""
    base, _, rest = link.partition("/t/")
    terrain, _, secret = rest.partition("#")
    request = urllib.request.Request(
        f"{base}/api/terrains/{terrain}/preview", headers={"Authorization": f"Bearer {secret}"}
    )
    told = json.loads(urllib.request.urlopen(request, timeout=30).read())
    for _ in range(40):  # each waits for the picture for 20 seconds, and it is drawn when nothing else is to be done
        try:
            data = urllib.request.urlopen(f"{base}/preview/{told['token']}.jpg", timeout=60).read()
        except urllib.error.HTTPError as error:
            code = json.loads(error.read())["code"]
            if code == "no_pictures":
                return
            assert code == "busy"
        else:
            with Image.open(io.BytesIO(data)) as made:
                assert (made.format, made.size) == ("JPEG", (previews.WIDTH, previews.HEIGHT))
            return
    pytest.fail("the picture does not come")


def test_what_needs_a_checkout_says_so(python: Path, tmp_path: Path) -> None:
    """SPEC H165."""
    command = [str(python), "-m", "esker", "bench", "solve"]
    done = subprocess.run(command, cwd=tmp_path, env=_clean(), capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "checkout" in done.stderr
    assert "Traceback" not in done.stderr
    scenes = _run(python, "-c", "from esker.templates import gallery; print(len(gallery.load('five').strokes))")
    assert int(scenes) == 5, "those that measure the solver have their scenes"
