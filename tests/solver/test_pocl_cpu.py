"""What PoCL compiles for on each processor: a table of names and flags (SPEC S28, S140)."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import pytest

from esker.solve.opencl.pocl import cpu, home
from esker.solve.opencl.pocl.cpu import LEVELS, choose, own_library

SSE2 = frozenset(["fpu", "cx16", "sse", "sse2"])
NEHALEM = SSE2 | frozenset(["ssse3", "sse4_1", "sse4_2", "popcnt"])
GOLDMONT = NEHALEM | frozenset(["movbe", "rdrand", "clflushopt", "sha_ni"])
SANDY = NEHALEM | {"avx"}
IVY = SANDY | {"f16c", "rdrand"}
BULLDOZER = SANDY | frozenset(["xop", "fma4", "abm"])
PILEDRIVER = BULLDOZER | frozenset(["f16c", "fma", "bmi1"])
HASWELL = IVY | frozenset(["avx2", "fma", "bmi1", "bmi2", "abm", "movbe"])
ZEN = HASWELL | frozenset(["adx", "clflushopt", "sha_ni", "sse4a"])
SKX = HASWELL | frozenset(["avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"])
ICELAKE = SKX | frozenset(["avx512vbmi", "avx512_vbmi2", "avx512_vnni", "vaes"])
KNL = HASWELL | frozenset(["avx512f", "avx512cd", "avx512er", "avx512pf"])

TABLE = [
    # processor, what LLVM 14 calls it, its flags, PoCL's own library, the level to compile for
    ("Zen 1", "znver1", ZEN, "avx2", "haswell"),
    ("Zen 2", "znver2", ZEN, "avx2", "haswell"),
    ("Zen 3", "znver3", ZEN, "avx2", "haswell"),
    ("Zen 4", "znver3", ICELAKE | ZEN, "avx512", "skylake-avx512"),
    ("Zen 5", "generic", ICELAKE | ZEN, "avx512", "skylake-avx512"),
    ("Zen 5 with AVX-512 masked", "generic", ZEN, "avx2", "haswell"),
    ("Haswell", "haswell", HASWELL, "avx2", "haswell"),
    ("Broadwell", "broadwell", HASWELL | {"adx"}, "avx2", "haswell"),
    ("Skylake", "skylake", ZEN, "avx2", "haswell"),
    ("Skylake-X", "skylake-avx512", SKX, "avx512", "skylake-avx512"),
    ("Cascade Lake", "cascadelake", SKX | {"avx512_vnni"}, "avx512", "skylake-avx512"),
    ("Cannon Lake", "cannonlake", SKX | {"avx512vbmi"}, "avx512", "skylake-avx512"),
    ("Ice Lake", "icelake-server", ICELAKE, "avx512", "skylake-avx512"),
    ("Tiger Lake", "tigerlake", ICELAKE, "avx512", "skylake-avx512"),
    ("Rocket Lake", "rocketlake", ICELAKE, "avx512", "skylake-avx512"),
    ("Sapphire Rapids", "sapphirerapids", ICELAKE | {"amx_tile"}, "avx512", "skylake-avx512"),
    ("Emerald Rapids, guessed by LLVM", "icelake-client", ICELAKE, "avx512", "skylake-avx512"),
    ("Granite Rapids, guessed by LLVM", "icelake-client", ICELAKE | {"amx_fp16"}, "avx512", "skylake-avx512"),
    ("Alder Lake", "alderlake", ZEN, "avx2", "haswell"),
    ("Alder Lake with AVX-512 left on", "alderlake", ICELAKE, "avx512", "skylake-avx512"),
    ("Raptor Lake, taken for an Atom", "goldmont", ZEN, "avx2", "haswell"),
    ("Knights Landing, no AVX-512 BW", "knl", KNL, "avx512", "haswell"),
    ("Haswell without AVX in a virtual machine", "haswell", NEHALEM, "sse41", "penryn"),
    ("Skylake-X without AVX-512 in a virtual machine", "skylake-avx512", HASWELL, "avx2", "haswell"),
    ("AVX2 without BMI2", "haswell", HASWELL - {"bmi2"}, "avx_f16c", "ivybridge"),
    ("Ivy Bridge", "ivybridge", IVY, "avx_f16c", "ivybridge"),
    ("Sandy Bridge", "sandybridge", SANDY, "avx", "sandybridge"),
    ("Bulldozer", "bdver1", BULLDOZER, "avx_fma4", "sandybridge"),
    ("Piledriver", "bdver2", PILEDRIVER, "avx_fma4", "ivybridge"),
    ("Nehalem", "nehalem", NEHALEM, "sse41", "penryn"),
    ("Gemini Lake", "goldmont-plus", GOLDMONT, "sse41", "penryn"),
    ("Elkhart Lake", "tremont", GOLDMONT, "sse41", "penryn"),
    ("Core 2", "core2", SSE2 | {"ssse3"}, "ssse3", "core2"),
    ("Athlon 64", "athlon64", SSE2 - {"cx16"}, "sse2", "x86-64"),
    ("unknown, no AVX", "generic", NEHALEM, "sse41", "penryn"),
    ("x86-64 and nothing more", "x86-64", frozenset({"sse2"}), "sse2", "x86-64"),
]  # fmt: skip


@pytest.mark.parametrize(("_", "name", "has", "library", "level"), TABLE, ids=[row[0] for row in TABLE])
def test_name_and_library_agree(_: str, name: str, has: frozenset[str], library: str, level: str) -> None:
    """SPEC S140."""
    assert own_library(has) == library
    found = choose(name, has)
    assert found is not None
    assert found.level.name == level
    assert found.level.needs <= has
    assert found.rename == (None if name == level else level)
    assert found.forced == (found.level.library != library)


def test_no_level_fits() -> None:
    assert choose("arm1176", frozenset({"half", "thumb"})) is None
    assert choose("generic", frozenset()) is None


@pytest.mark.parametrize("limit", cpu.NAMES)
def test_a_limit_is_the_widest_level(limit: str) -> None:
    """SPEC S143."""
    found = choose("sapphirerapids", ICELAKE, limit)
    assert found is not None
    assert found.level.name == limit
    assert found.forced == (limit != "skylake-avx512")
    narrow = choose("core2", SSE2 | {"ssse3"}, limit)
    assert narrow is not None
    assert narrow.level.name == ("x86-64" if limit == "x86-64" else "core2")


def test_a_level_that_is_none_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from esker.solve.opencl.device import open_device
    from esker.solve.opencl.faults import NoDeviceError

    monkeypatch.setenv("ESKER_CPU_LEVEL", "pentium")
    with pytest.raises(NoDeviceError, match=r"skylake-avx512.*'pentium'.*ESKER_CPU_LEVEL"):
        open_device()


def test_levels_narrow_one_by_one() -> None:
    """SPEC S141: there is always a narrower level to try but after the last."""
    assert [level.name for level in cpu.levels(ICELAKE)] == list(cpu.NAMES)
    for wider, narrower in itertools.pairwise(LEVELS):
        assert choose("generic", wider.needs | SSE2 | NEHALEM) is not None
        assert wider.library != narrower.library


def test_flags_are_those_of_the_first_processor(tmp_path: Path) -> None:
    info = tmp_path / "cpuinfo"
    info.write_text("processor : 0\nflags : fpu sse2\n\nprocessor : 1\nflags : other\n")
    assert cpu.flags(info) == {"fpu", "sse2"}
    info.write_text("Features : half thumb\n")
    assert cpu.flags(info) == frozenset()
    assert cpu.flags(tmp_path / "none") == frozenset()


def test_what_is_compiled_is_kept_by_level(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC S28: code for one level is never found by another."""
    monkeypatch.setattr("os.environ", {"XDG_CACHE_HOME": str(tmp_path)})
    folders = {home.folder(level) for level in LEVELS}
    assert len(folders) == len(LEVELS)
    assert all(folder.is_relative_to(tmp_path / "esker") for folder in folders)


@pytest.mark.parametrize("given", [{"XDG_CACHE_HOME": "{}/file"}, {"POCL_KERNEL_CACHE": "0"}])
def test_where_nothing_can_be_kept_it_passes_with_the_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: dict[str, str]
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setattr("os.environ", {name: text.format(tmp_path) for name, text in given.items()})
    folder = home.root()
    assert folder.is_dir()
    assert not folder.is_relative_to(tmp_path)
    assert os.environ["ESKER_CACHE_DIR"] == str(folder), "children find it there"


def test_a_folder_of_the_user_s_own_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.environ", {"POCL_CACHE_DIR": str(tmp_path)})
    assert home.folder(LEVELS[1]) == tmp_path / "pocl-haswell"
    os.environ["POCL_CACHE_DIR"] = str(home.folder(LEVELS[1]))
    assert home.folder(LEVELS[2]) == tmp_path / "pocl-ivybridge", "not a folder in a folder"
