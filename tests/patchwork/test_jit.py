"""Compiled loops are kept for the text and for the arguments that they were compiled for (SPEC PW59, H562, H570)."""

from __future__ import annotations

import ast
import itertools
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeGuard

import pytest
from numba.core.caching import IndexDataCacheFile

from esker import compiled
from esker.compiled import LoopFiles
from esker.patchwork import jit

INNER = "from esker.patchwork.jit import kernel\n\n\n@kernel\ndef inner(x: float) -> float:\n    return x + {}\n"
OUTER = """from esker.patchwork.inner import inner
from esker.patchwork.jit import kernel


@kernel
def outer(x: float) -> float:
    return inner(x)


print(outer(1.0))
"""


def test_a_change_in_another_file_is_compiled_anew(tmp_path: Path) -> None:
    """PW59: numba by itself goes on with the old code of a function that is called from elsewhere."""
    room = tmp_path / "esker" / "patchwork"
    room.mkdir(parents=True)
    (room / "__init__.py").touch()
    (room.parent / "__init__.py").touch()
    for name in ("jit.py", "kept_loops.py"):
        shutil.copy(Path(jit.__file__).parent / name, room / name)
    shutil.copy(compiled.__file__, room.parent / "compiled.py")
    process = Path(jit.__file__).parents[1] / "process"
    shutil.copytree(process, room.parent / "process", ignore=shutil.ignore_patterns("__pycache__"))
    (room / "outer.py").write_text(OUTER)
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | {"PYTHONPATH": str(tmp_path)}
    said = []
    for added in (1, 20):
        (room / "inner.py").write_text(INNER.format(added))
        ran = subprocess.run(
            [sys.executable, "-m", "esker.patchwork.outer"], env=environment, capture_output=True, text=True, check=True
        )
        said.append(float(ran.stdout))
    assert said == [2.0, 21.0]
    assert len(list((room / "__pycache__").glob("compiled-*"))) == 1


CALLS = """import numpy as np
from esker.compiled import kernel


@kernel
def inner(numbers, at, backwards):
    return numbers[len(numbers) - 1 - at] if backwards else numbers[at]


@kernel
def outer(numbers, places):
    return inner(numbers, 0, False) + inner(numbers, 1, True) + inner(numbers, np.int64(places[0]), places[0] > 1)


print(outer(np.arange(9.0), np.full(1, 4, np.int32)), len(inner.signatures), len(outer.signatures))
"""


def test_a_loop_is_compiled_once_for_constants_and_variables(tmp_path: Path) -> None:
    """SPEC H570: numba makes a form of a loop for each constant that another calls it with."""
    (tmp_path / "calls.py").write_text(CALLS)
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    ran = subprocess.run(
        [sys.executable, "calls.py"], cwd=tmp_path, env=os.environ | kept, capture_output=True, text=True, check=True
    )
    assert ran.stdout == "11.0 1 1\n"


def test_nothing_assigns_one_array_to_a_slice_of_another() -> None:
    """SPEC H570: numba compiles how strings are made of numbers for each, to tell of sides that differ."""
    rooms = Path(compiled.__file__).parent
    assigned = []
    for path in rooms.rglob("*.py"):
        if "@kernel" not in (text := path.read_text()):
            continue
        for function in ast.walk(ast.parse(text)):
            if isinstance(function, ast.FunctionDef) and "kernel" in [
                ast.unparse(d).split(".")[-1] for d in function.decorator_list
            ]:
                assigned += [f"{path.name}:{each.lineno}" for each in ast.walk(function) if slices(each)]
    assert assigned == []


def slices(statement: ast.AST) -> TypeGuard[ast.Assign]:
    """Whether a slice is given anything but numbers."""
    if not isinstance(statement, ast.Assign):
        return False
    sliced = [
        isinstance(each, ast.Subscript) and any(isinstance(part, ast.Slice) for part in ast.walk(each.slice))
        for target in statement.targets
        for each in (target.elts if isinstance(target, ast.Tuple) else [target])
    ]
    values = statement.value.elts if isinstance(statement.value, ast.Tuple) else [statement.value]
    return any(sliced) and not all(isinstance(value, ast.Constant) for value in values)


def test_a_slice_of_an_array_is_seen() -> None:
    said = [slices(ast.parse(text).body[0]) for text in ("a[:] = b", "a[:], b[1:2] = 0, 1", "a[1], b = c, d[2:]")]
    assert said == [True, False, False]


NUMBA_S: Any = IndexDataCacheFile
Kept = Callable[[Any], Any]
"""What keeps code in files that numba reads and writes."""


def kept(folder: Path, stamp: str = "now") -> LoopFiles:
    return LoopFiles(NUMBA_S(str(folder), "loop", stamp))


class Turns:
    """Two processes that keep a function at the same time, step by step in a given order."""

    def __init__(self, folder: Path, keep: Kept, order: tuple[str, ...]) -> None:
        self._folder, self._keep, self._order, self._at = folder, keep, order, 0
        self._changed = threading.Condition()
        self._done: set[str] = set()
        self.wrong: list[str] = []

    def run(self) -> None:
        threads = [threading.Thread(target=self._save, args=(key,)) for key in "ab"]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        self._look()

    def _save(self, key: str) -> None:
        files = NUMBA_S(str(self._folder), "loop", "now")
        for name in ("_load_index", "_save_index", "_save_data"):
            setattr(files, name, self._stepped(key, getattr(files, name)))
        self._keep(files).save(key, f"code for {key}")
        with self._changed:
            self._done.add(key)
            self._changed.notify_all()

    def _stepped(self, key: str, work: Callable[..., Any]) -> Callable[..., Any]:
        def step(*arguments: Any) -> Any:
            with self._changed:
                self._changed.wait_for(lambda: self._is_due(key), 60)
                done = work(*arguments)
                self._at += 1
                self._changed.notify_all()
            self._look()
            return done

        return step

    def _is_due(self, key: str) -> bool:
        """Whether it is the turn of this one; the order is over when either has no step left."""
        return self._at >= len(self._order) or self._order[self._at] == key or self._order[self._at] in self._done

    def _look(self) -> None:
        """What a third process finds: the code for what it asks for, or none."""
        for key in "ab":
            if (found := kept(self._folder).load(key)) not in (None, f"code for {key}"):
                self.wrong.append(f"{found} for {key}")


ORDERS = sorted(set(itertools.permutations("aaabbb")))


@pytest.mark.parametrize("order", ORDERS, ids="".join)
def test_whoever_looks_finds_the_code_for_its_own_arguments(tmp_path: Path, order: tuple[str, ...]) -> None:
    """SPEC H562: whatever two processes do meanwhile that compile the function for other arguments."""
    turns = Turns(tmp_path, LoopFiles, order)
    turns.run()
    assert turns.wrong == []


def test_numba_s_own_files_give_one_name_to_two_codes(tmp_path: Path) -> None:
    """SPEC H562: the reason for files of our own; they may go when this no longer holds."""
    wrong = []
    for order in ORDERS:
        folder = tmp_path / "".join(order)
        folder.mkdir()
        turns = Turns(folder, lambda files: files, order)
        turns.run()
        wrong += turns.wrong
    assert wrong


def test_a_loop_of_an_earlier_source_is_neither_found_nor_left(tmp_path: Path) -> None:
    """SPEC H562."""
    for stamp in ("before", "now"):
        for key in "ab":
            kept(tmp_path, stamp).save(key, f"{stamp} {key}")
    assert [kept(tmp_path).load(key) for key in "ab"] == ["now a", "now b"]
    assert kept(tmp_path, "before").load("a") is None
    assert len(list(tmp_path.glob("loop.*.nbc"))) == 2


def test_a_kernel_is_kept_in_these_files() -> None:
    made: Any = jit.kernel(lambda x: x)
    assert isinstance(made._cache._cache_file, LoopFiles)


def test_a_function_stays_itself_where_numba_is_told_not_to_compile() -> None:
    """Whoever debugs sets `NUMBA_DISABLE_JIT`, and everything is to run all the same."""
    ran = subprocess.run(
        [sys.executable, "-c", "from esker import compiled; print(compiled.kernel(lambda x: x + 1)(2))"],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.stdout.strip() == "3", ran.stderr
