"""The README's examples are extracted, compiled and run as they stand."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import tomllib
from decimal import Decimal
from pathlib import Path

import pytest

from codegen.controller import load, resolve

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PUMA3 = ROOT / "generated" / "puma3"

MAIN = r"""
#include <math.h>
#include <stdio.h>
#include "tdc_puma3.h"

tdc_status start(const int32_t counts[3], const float holding_torque_Nm[3]);
tdc_status tick(const tdc_puma3_input *input, float torque_Nm[3]);

int main(void)
{
    const int32_t counts[3] = {0, 0, 0};
    const float holding[3] = {0.0f, -20.0f, 5.0f};
    float torque[3] = {0.0f, 0.0f, 0.0f};
    const tdc_puma3_input rest = {.counts = {0, 0, 0}};
    if (start(counts, holding) != TDC_OK) {
        return 1;
    }
    if (tick(&rest, torque) != TDC_OK) {
        return 2;
    }
    printf("%g %g %g\n", (double)torque[0], (double)torque[1], (double)torque[2]);
    return 0;
}
"""


def fenced(language: str, containing: str) -> str:
    """The one code block of a language that contains a word."""
    blocks = re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
    found = [b for b in blocks if containing in b]
    assert len(found) == 1, f"{len(found)} blocks of {language} contain {containing!r}"
    return str(found[0])


def test_the_c_example_compiles_without_a_warning_and_holds_the_robot(tmp_path: Path) -> None:
    (tmp_path / "example.c").write_text(
        fenced("c", "tdc_puma3_init").replace(
            "/* Once,",
            "tdc_status start(const int32_t counts[3], const float holding_torque_Nm[3]);\n"
            "tdc_status tick(const tdc_puma3_input *input, float torque_Nm[3]);\n/* Once,",
        )
    )
    (tmp_path / "main.c").write_text(MAIN)
    program = tmp_path / "example"
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wstrict-prototypes",
               "-Werror", f"-I{PUMA3}", "-o", str(program), str(tmp_path / "example.c"),
               str(tmp_path / "main.c"), *map(str, PUMA3.glob("*.c"))]  # fmt: skip
    subprocess.run(command, check=True)
    done = subprocess.run([program], check=True, capture_output=True, text=True)
    assert done.stdout == "0 -20 5\n"


def test_the_cross_compiler_line_works_in_the_generated_directory(tmp_path: Path) -> None:
    for path in PUMA3.iterdir():
        shutil.copy(path, tmp_path)
    line = fenced("sh", "arm-none-eabi-gcc").replace("\\\n", " ")
    subprocess.run(shlex.split(line), check=True, cwd=tmp_path)


def test_the_specification_is_the_committed_one() -> None:
    data = tomllib.loads(fenced("toml", "puma3"), parse_float=Decimal)
    committed = load(ROOT / "controllers" / "puma3.toml")
    assert resolve(data).joints == committed.joints


def test_the_line_of_the_law_is_in_the_generated_c() -> None:
    line = fenced("c", "(26)").strip()
    assert line in (PUMA3 / "tdc_puma3.c").read_text(encoding="utf-8")


@pytest.mark.parametrize("link", re.findall(r"\]\((?!https?:)([^)#]+)", README))
def test_every_file_that_it_points_to_is_there(link: str) -> None:
    assert (ROOT / link).exists()
