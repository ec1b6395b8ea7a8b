"""docs/on-your-microcontroller.md: its control loop is compiled and run with a board that fails."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from tests.repository.conftest import ROOT
from tests.repository.markdown import parse

PAGE = Path("docs/on-your-microcontroller.md")
TEXT = (ROOT / PAGE).read_text(encoding="utf-8")
PUMA3 = ROOT / "generated" / "puma3"
BOARD = r"""
#include <stdio.h>
#include "loop.c"

static unsigned tick;
static unsigned brakes;

void board_read_counts(int32_t counts[TDC_PUMA3_JOINTS])
{
    /* A dropout of two ticks, and later one that lasts. */
    const int bad = (tick == 5u) || (tick == 6u) || (tick >= 20u);
    for (unsigned i = 0u; i < TDC_PUMA3_JOINTS; ++i) {
        counts[i] = bad ? 0 : 100000;
    }
}

void board_read_reference(tdc_puma3_input *input)
{
    for (unsigned i = 0u; i < TDC_PUMA3_JOINTS; ++i) {
        input->reference_position_q8[i] = 256 * 100000;
        input->reference_velocity_rad_per_s[i] = 0.0f;
        input->reference_acceleration_rad_per_s2[i] = 0.0f;
    }
}

void board_write_torque(const float torque_Nm[TDC_PUMA3_JOINTS])
{
    printf("%u %g %g %g\n", tick, (double)torque_Nm[0], (double)torque_Nm[1],
           (double)torque_Nm[2]);
}

void board_engage_brakes(void)
{
    if (brakes++ == 0u) {
        printf("brakes %u\n", tick);
    }
}

int main(void)
{
    const float holding_torque_Nm[TDC_PUMA3_JOINTS] = {0.0f, -20.0f, 5.0f};
    if (controller_start(holding_torque_Nm) != TDC_OK) {
        return 1;
    }
    for (tick = 0u; tick < 45u; ++tick) {
        controller_tick();
    }
    printf("bytes %u %u\n", (unsigned)sizeof state, (unsigned)sizeof config);
    return 0;
}
"""


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """What the page's loop does on such a board."""
    folder = tmp_path_factory.mktemp("loop")
    (block,) = (b for b in parse(PAGE, TEXT).blocks if b.language == "c")
    declared = "tdc_status controller_start(const float holding_torque_Nm[TDC_PUMA3_JOINTS]);\n"
    declared += "void controller_tick(void);\n"
    include = '#include "tdc_puma3.h"\n'
    assert block.text.startswith(include)
    (folder / "loop.c").write_text(block.text.replace(include, include + declared), "utf-8")
    (folder / "board.c").write_text(BOARD, encoding="utf-8")
    warnings = ("-Wall", "-Wextra", "-Wconversion", "-Wstrict-prototypes", "-Werror")
    subprocess.run(
        ["gcc", "-std=c99", *warnings, "-I", PUMA3, "-I", folder, "-o", folder / "board",
         folder / "board.c", *PUMA3.glob("*.c")],
        check=True,
    )  # fmt: skip
    done = subprocess.run([folder / "board"], check=True, capture_output=True, text=True)
    return done.stdout.splitlines()


def test_the_loop_rides_through_two_lost_ticks_and_brakes_at_the_fourth(printed: list[str]) -> None:
    assert [line for line in printed if line.startswith("brakes")] == ["brakes 23"]


def test_the_torque_holds_the_robot_until_too_many_ticks_are_lost(printed: list[str]) -> None:
    torques = {int(line.split()[0]): line.split()[1:] for line in printed if line[0].isdigit()}
    held = [torques[tick] == ["0", "-20", "5"] for tick in range(45)]
    stopped = next(tick for tick in range(45) if not held[tick])
    assert stopped >= 30
    assert all(torques[tick] == ["0", "0", "0"] for tick in range(stopped, 45))


def test_the_sizes_are_those_of_the_text(printed: list[str]) -> None:
    _, state, config = printed[-1].split()
    assert f"`tdc_puma3_state` is {state} bytes" in TEXT
    assert f"`tdc_puma3_config` {config} bytes" in TEXT


def test_every_status_has_a_row() -> None:
    from codegen.status import Status

    table = set(re.findall(r"`TDC_(\w+)`", TEXT.split("## 5.")[1].split("## 6.")[0]))
    assert table == {status.name for status in Status}
