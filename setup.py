"""Puts into the wheel what lies beside the package in a checkout: shaders, page, scenes (``esker.resources``).

An editable install takes nothing along: there the files stay where they are.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

HERE = Path(__file__).resolve().parent
TAKEN = {"shaders": "shaders", "frontend/dist": "page", "bench/scenes": "scenes"}


class BuildWithFiles(build_py):
    """The usual step, and the files."""

    def run(self) -> None:
        if self.editable_mode:
            super().run()
            return
        if not (HERE / "frontend/dist/index.html").is_file():
            raise SystemExit("The page is not built yet: `make wheel` builds it first.")
        shutil.rmtree(Path(self.build_lib) / "esker", ignore_errors=True)  # files of an earlier build that are gone now
        super().run()
        for source, name in TAKEN.items():
            target = Path(self.build_lib) / "esker/files" / name
            shutil.copytree(HERE / source, target)


setup(cmdclass={"build_py": BuildWithFiles})
