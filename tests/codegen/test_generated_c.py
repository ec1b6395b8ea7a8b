"""The generated C as a compiler and a linker see it: no warning, no double, no library."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.codegen.conftest import GENERATED, VARIANTS
from tests.toolchain import CORTEX_M4F, WARNINGS, run

COMMITTED = ("puma3", "puma6")


def compile_all(compiler: list[str], directory: Path, output: Path) -> list[Path]:
    """One object for each C file of the directory."""
    objects = []
    for source in sorted(directory.glob("*.c")):
        objects.append(output / f"{source.stem}.o")
        run(*compiler, "-c", source, "-o", objects[-1])
    return objects


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("optimisation", ["-O0", "-O2"])
@pytest.mark.parametrize("name", COMMITTED)
def test_no_warning(compiler: str, optimisation: str, name: str, tmp_path: Path) -> None:
    flags = [compiler, *WARNINGS, "-ffp-contract=off", optimisation]
    assert compile_all(flags, GENERATED / name, tmp_path)


@pytest.mark.parametrize("name", VARIANTS)
def test_no_warning_in_any_structure_of_the_law(
    name: str, variant_sources: Callable[[str], Path], tmp_path: Path
) -> None:
    assert compile_all(["gcc", *WARNINGS, "-O2"], variant_sources(name), tmp_path)


@pytest.mark.parametrize("name", COMMITTED)
@pytest.mark.parametrize("optimisation", ["-O2", "-Os"])
def test_on_a_cortex_m4f_nothing_is_missing_but_memcpy(
    name: str, optimisation: str, tmp_path: Path
) -> None:
    objects = compile_all(
        ["arm-none-eabi-gcc", *CORTEX_M4F, *WARNINGS, optimisation, "-ffp-contract=off"],
        GENERATED / name,
        tmp_path,
    )
    joined = tmp_path / "all.o"
    run("arm-none-eabi-ld", "-r", *objects, "-o", joined)
    undefined = {line.split()[-1] for line in run("arm-none-eabi-nm", "-u", joined).splitlines()}
    assert undefined <= {"memcpy"}
    # No software double (__aeabi_d*, __aeabi_f2d), no static RAM, no hidden state.
    symbols = run("arm-none-eabi-nm", joined).split()
    assert not [s for s in symbols if s.startswith("__aeabi")]
    sections = run("arm-none-eabi-size", "-A", joined).splitlines()
    sizes = {line.split()[0]: int(line.split()[1]) for line in sections if line.startswith(".")}
    assert sizes.get(".data", 0) == sizes.get(".bss", 0) == 0


def test_the_check_for_double_would_notice_one(tmp_path: Path) -> None:
    source = tmp_path / "double.c"
    source.write_text("float f(float x) { return (float)(x * 0.1); }\n")
    done = subprocess.run(
        ["gcc", *WARNINGS, "-c", str(source), "-o", str(tmp_path / "double.o")],
        capture_output=True,
        check=False,
    )
    assert done.returncode != 0
    run("arm-none-eabi-gcc", *CORTEX_M4F, "-O2", "-c", source, "-o", tmp_path / "double.o")
    assert "__aeabi_dmul" in run("arm-none-eabi-nm", "-u", tmp_path / "double.o")


def test_two_controllers_link_into_one_program(tmp_path: Path) -> None:
    main = tmp_path / "main.c"
    main.write_text(
        '#include "tdc_puma3.h"\n#include "tdc_puma6.h"\n'
        "int main(void)\n{\n"
        "    return (tdc_puma3_check_config(&tdc_puma3_default_config) == TDC_OK &&\n"
        "            tdc_puma6_check_config(&tdc_puma6_default_config) == TDC_OK &&\n"
        "            tdc_puma3_check_config(0) == TDC_BAD_ARGUMENT) ? 0 : 1;\n}\n"
    )
    sources = [GENERATED / n / f"tdc_{n}.c" for n in COMMITTED]
    includes = [f"-I{GENERATED / n}" for n in COMMITTED]
    program = tmp_path / "two"
    kernel = GENERATED / "puma3" / "tdc_sig_pow.c"
    run("gcc", *WARNINGS, *includes, main, *sources, kernel, "-o", program)
    run(program)


def test_the_shared_files_are_the_same_for_all_controllers() -> None:
    for name in ("tdc.h", "tdc_sig_pow.h", "tdc_sig_pow.c"):
        assert len({(GENERATED / c / name).read_bytes() for c in COMMITTED}) == 1


def test_the_header_serves_cpp(tmp_path: Path) -> None:
    source = tmp_path / "use.cpp"
    source.write_text('#include "tdc_puma3.h"\ntdc_puma3_state state;\n')
    run("g++", "-std=c++11", "-Wall", "-Wextra", "-Werror", f"-I{GENERATED / 'puma3'}",
        "-c", source, "-o", tmp_path / "use.o")  # fmt: skip
