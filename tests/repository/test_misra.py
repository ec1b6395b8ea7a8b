"""tools/misra.py: every finding needs a reason, every reason a finding."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.misra import (
    DeviationError,
    Finding,
    deviations,
    findings,
    main,
    page,
    reasons_beside,
    reasons_for_all,
)

BESIDE = Finding("10.1", "tdc.h", 7)
ELSEWHERE = Finding("8.7", "tdc.h", 9)
REASONS = {BESIDE: "x is positive"}
FOR_ALL = {"8.7": "A library."}


def test_findings_are_grouped_by_rule_and_reason() -> None:
    more = Finding("8.7", "tdc_fixed.h", 3)
    made = deviations([ELSEWHERE, more, BESIDE], REASONS, FOR_ALL)
    assert [(d.rule, d.reason, d.beside, d.places) for d in made] == [
        ("8.7", "A library.", False, (ELSEWHERE, more)),
        ("10.1", "x is positive", True, (BESIDE,)),
    ]
    text = page(made, 99)
    assert "| 8.7 | 2 | `tdc.h`, `tdc_fixed.h` | A library (the whole rule) |" in text
    assert "| 10.1 | 1 | `tdc.h` | x is positive (beside it) |" in text


@pytest.mark.parametrize(
    ("found", "says"),
    [
        ([ELSEWHERE, BESIDE, Finding("15.5", "tdc.h", 1)], "tdc.h:1: rule 15.5 has no reason"),
        # The reason stands beside another line.
        (
            [ELSEWHERE, Finding("10.1", "tdc.h", 8)],
            "tdc.h:7: nothing breaks rule 10.1 here\ntdc.h:8: rule 10.1 has no reason",
        ),
        ([BESIDE], "cppcheck_suppressions.txt: nothing breaks rule 8.7"),
    ],
)
def test_what_does_not_match_is_named(found: list[Finding], says: str) -> None:
    with pytest.raises(DeviationError) as error:
        deviations(found, REASONS, FOR_ALL)
    assert str(error.value) == says


def test_reasons_are_read_beside_a_place_and_above_it(tmp_path: Path) -> None:
    folder = tmp_path / "generated/demo"
    folder.mkdir(parents=True)
    (folder / "demo.c").write_text(
        "int a; /* cppcheck-suppress misra-c2012-10.1 ; beside */\n"
        "    /* cppcheck-suppress misra-c2012-17.3 ; above */\n"
        "int b;\n",
        encoding="utf-8",
    )
    assert reasons_beside(tmp_path) == {
        Finding("10.1", "demo.c", 1): "beside",
        Finding("17.3", "demo.c", 3): "above",
    }
    text = (
        "// A reason\n// of two lines.\nmisra-c2012-2.5\nmisra-c2012-8.7\n\n// Not ours.\nunused\n"
    )
    assert reasons_for_all(text) == dict.fromkeys(("2.5", "8.7"), "A reason of two lines.")


def test_a_finding_in_c_without_a_reason_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "generated/demo"
    folder.mkdir(parents=True)
    (folder / "demo.c").write_text(
        "int f(int x);\nint f(int x)\n{\n    if (x > 1) {\n        return 1;\n    }\n"
        "    return x;\n}\n",
        encoding="utf-8",
    )
    assert Finding("15.5", "demo.c", 5) in findings(tmp_path)
    assert main(["--root", str(tmp_path)]) == 1
    assert "demo.c:5: rule 15.5 has no reason" in capsys.readouterr().err
    assert not (tmp_path / "docs").exists()
