"""The specification: what is accepted, what is refused, and in which words."""

from __future__ import annotations

import json
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codegen.__main__ import main
from codegen.controller import Controller, load, read, resolve
from codegen.presets import LAW_PRESETS, SPECIAL_CASES
from codegen.problems import Problem, SpecificationError
from codegen.specification import json_schema

CONTROLLERS = Path(__file__).parents[2] / "controllers"
REMOVED = "(removed)"


def puma3() -> dict[str, Any]:
    return read(CONTROLLERS / "puma3.toml")


def changed(key: str, value: object, base: dict[str, Any] | None = None) -> dict[str, Any]:
    """The specification with one dotted key changed, added or removed."""
    data = puma3() if base is None else base
    *tables, last = key.split(".")
    here = data
    for table in tables:
        here = here.setdefault(table, {})
    if value is REMOVED:
        del here[last]
    else:
        here[last] = value
    return data


def problems_of(data: dict[str, Any]) -> tuple[Problem, ...]:
    with pytest.raises(SpecificationError) as caught:
        resolve(data)
    return caught.value.problems


def test_the_paper_robot_has_exact_numbers() -> None:
    controller = load(CONTROLLERS / "puma3.toml")
    assert [j.inertia for j in controller.joints] == [
        Fraction(3818, 10_000),
        Fraction(30545, 100_000),
        Fraction(15296, 100_000),
    ]
    joint = controller.joints[0]
    assert [joint.alpha, joint.beta, joint.gamma] == [
        Fraction(95, 100),
        Fraction(95, 105),
        Fraction(2, 5),
    ]
    # Section IV-A of the paper: the joint's resolution is 3.66e-4 degrees.
    assert float(360 / joint.counts_per_joint_rev) == pytest.approx(3.66e-4, rel=1e-3)
    assert joint.torque_limit == Fraction("0.637") * 120


# key, value, key in the message, words of the rule, words of the fix
BAD = [
    ("law.kd", "fast", "law.kd", "a finite number", "write a number"),
    ("law.kd", True, "law.kd", "a finite number", "true"),
    ("law.kd", [20, "x", 20], "law.kd[1]", "a finite number", "write a number"),
    ("law.kd", [20, 20], "law.kd", "each of the 3 joints; here are 2", "give 3 values"),
    ("law.kd", [], "law.kd", "each of the 3 joints; here are 0", "give 3 values"),
    ("law.kp", -100, "law.kp", "0 or greater", "positive"),
    ("law.kp", [100, 100, -1], "law.kp[2]", "0 or greater", "positive"),
    ("law.inertia_kgm2", 0, "law.inertia_kgm2", "greater than 0", "positive"),
    ("law.kp", 1e-50, "law.kp", "binary32", "unit"),
    ("law.kp", Decimal("1e-999999999"), "law.kp", "binary32", "unit"),
    ("law.kp", Decimal("1e999999999"), "law.kp", "binary32", "unit"),
    ("law.kp", Decimal("nan"), "law.kp", "a finite number", "NaN"),
    ("law.kp", float("inf"), "law.kp", "a finite number", "inf"),
    ("law.kp", float("nan"), "law.kp", "a finite number", "nan"),
    ("law.kp", "1/0", "law.kp", "a finite number", "1/0"),
    ("law.alpha", 2, "law.alpha", "0 < alpha < 2", "linear"),
    ("law.alpha", 0, "law.alpha", "0 < alpha < 2", "linear"),
    ("law.alpha", 1, "law.beta", "finite time for 0 < alpha < 1", "lower alpha"),
    ("law.beta", 2.5, "law.beta", "0 < beta < 2", "linear"),
    ("law.beta", "finite", "law.beta", "finite-time", "finite-time"),
    ("law.gamma", -0.1, "law.gamma", "0 <= gamma < 2", "sliding mode"),
    ("law.gamma", 1, "law.gamma", 'preset "enhanced" (31) needs 0 < gamma < 1', "another preset"),
    ("law.lambda", 0, "law.lambda", "needs 0 < lambda", "another preset"),
    ("law.lamda", 20, "law.lamda", "a known key", 'did you mean "lambda"'),
    ("law.preset", "enhaced", "law.preset", "one of hsia", 'did you mean "enhanced"'),
    ("law.preset", 3, "law.preset", "one of hsia", "one of them"),
    ("law.preset", "hsia", "law.alpha", "fixes alpha = 1", "remove alpha"),
    ("law.velocity_error", "exact", "law.velocity_error", "reference-rate", "How ed is formed"),
    ("law.low_pass_rad_per_s", 0, "law.low_pass_rad_per_s", "greater than 0", "positive"),
    ("sample_time_s", 0, "sample_time_s", "greater than 0", "positive"),
    ("sample_time_s", 1000, "sample_time_s", "at most 1 s", "seconds"),
    ("sample_tme_s", 1, "sample_tme_s", "a known key", 'did you mean "sample_time_s"'),
    ("robot", "faraman", "robot", "one of faraman-at2", "faraman-at2"),
    ("name", "Puma-3", "name", "C identifier", "puma3"),
    ("name", REMOVED, "name", "needed", "Name of the controller"),
    ("joint_names", [], "joint_names", "at least 1", "number of joints"),
    ("joint_names", ["a", "b", "a"], "joint_names", "every name once", "rename"),
    ("joint_names", ["*/", "b", "c"], "joint_names[0]", "match pattern", ""),
    ("encoder.gear_ratio", 0, "encoder.gear_ratio", "not 0", "ratio"),
    ("drive.torque_limit_Nm", -1, "drive.torque_limit_Nm", "greater than 0", "positive"),
    ("drive.reports_torque", "perhaps", "drive.reports_torque", "boolean", "Whether the drive"),
    ("safety.on_error", "panic", "safety.on_error", '"hold" or "zero"', "Torque of a lost tick"),
    ("safety.max_speed_rad_per_s", REMOVED, "safety.max_speed_rad_per_s", "needed", "jump"),
    ("safety.max_speed_rad_per_s", 1e9, "safety.max_speed_rad_per_s", "2^30", "unit"),
    ("safety", REMOVED, "safety", "needed", "[safety]"),
    ("law", 5, "law", "valid dictionary", ""),
]


@pytest.mark.parametrize(
    ("key", "value", "named", "rule", "fix"), BAD, ids=[f"{b[0]}={b[1]}"[:40] for b in BAD]
)
def test_what_is_wrong_is_refused_with_key_rule_and_fix(
    key: str, value: object, named: str, rule: str, fix: str
) -> None:
    problems = problems_of(changed(key, value))
    matching = [p for p in problems if p.key == named]
    assert matching, f"{named} is not among {[p.key for p in problems]}"
    assert rule in matching[0].rule
    assert fix in matching[0].fix


def test_all_mistakes_are_told_at_once() -> None:
    data = changed("law.kd", -1)
    data = changed("law.kp", "x", data)
    assert {p.key for p in problems_of(changed("nmae", "y", data))} == {"law.kd", "law.kp", "nmae"}


@pytest.mark.parametrize("preset", SPECIAL_CASES, ids=lambda p: p.name)
def test_every_special_case_is_its_law(preset: Any) -> None:
    data = puma3()
    data["law"] = {"preset": preset.name}
    joint = resolve(data).joints[2]
    for key, value in preset.fixed.items():
        assert getattr(joint, "lambda_" if key == "lambda" else key) == Fraction(str(value))
    assert joint.inertia == Fraction("0.15296")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("hsia", (0, 1, 1, 1)),
        ("jin", (20, 1, 1, 1)),
        ("sliding-mode", (20, 1, 1, 0)),
        ("terminal-sliding", (20, 1, 1, Fraction(2, 5))),
        ("nonlinear-ded", (0, Fraction(19, 20), Fraction(19, 21), 1)),
        ("enhanced", (20, Fraction(19, 20), Fraction(19, 21), Fraction(2, 5))),
        ("Exp06", (20, Fraction(49, 50), Fraction(49, 51), Fraction(2, 5))),
        ("Exp13", (0, Fraction(3, 2), Fraction(3, 2), 1)),
    ],
)
def test_an_experiment_replaces_the_gains(name: str, expected: tuple[Any, ...]) -> None:
    joint = load(CONTROLLERS / "puma3.toml", experiment=name).joints[0]
    assert (joint.lambda_, joint.alpha, joint.beta, joint.gamma) == expected
    assert [joint.kd, joint.kp] == [20, 100]


def test_the_rows_of_table_two_are_all_there() -> None:
    assert [n for n in LAW_PRESETS if n.startswith("Exp")] == [f"Exp{i:02}" for i in range(1, 14)]


@given(alpha=st.fractions(Fraction(1, 1000), Fraction(999, 1000)))
def test_finite_time_beta_is_exact(alpha: Fraction) -> None:
    data = changed("law.alpha", f"{alpha.numerator}/{alpha.denominator}")
    beta = resolve(data).joints[0].beta
    assert beta == alpha / (2 - alpha)


_SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.just({})
)
_KEYS = (
    *("name", "robot", "joint_names", "sample_time_s", "law", "law.kd", "law.alpha", "law.beta"),
    *("law.preset", "law.gamma", "encoder", "encoder.counts_per_rev", "drive", "extra"),
    *("drive.torque_limit_Nm", "safety", "safety.on_error"),
)


@given(key=st.sampled_from(_KEYS), value=st.one_of(_SCALARS, st.lists(_SCALARS, max_size=4)))
def test_no_value_makes_it_fail_otherwise_than_in_words(key: str, value: object) -> None:
    data = changed(key, value)
    try:
        outcome: Controller | SpecificationError = resolve(data)
    except SpecificationError as error:
        outcome = error
    assert isinstance(outcome, Controller) or all(p.key and p.rule for p in outcome.problems)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "No such file"),
        (b"name = ", "TOML"),
        (b"\xff\xfe", "UTF-8"),
        (b'name = "x"\nname = "y"', "TOML"),
    ],
    ids=["missing", "no TOML", "no UTF-8", "double key"],
)
def test_an_unreadable_file_exits_with_2_and_writes_nothing(
    content: bytes | None, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "robot.toml"
    if content is not None:
        path.write_bytes(content)
    output = tmp_path / "generated"
    assert main(["generate", str(path), "--output", str(output)]) == 2
    message = capsys.readouterr().err
    assert str(path) in message
    assert words in message
    assert not output.exists()


def test_a_directory_is_no_specification(tmp_path: Path) -> None:
    with pytest.raises(SpecificationError, match="directory"):
        load(tmp_path)


def test_one_bad_specification_of_two_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = tmp_path / "bad.toml"
    text = (CONTROLLERS / "puma3.toml").read_text(encoding="utf-8")
    bad.write_text(text.replace("gamma = 0.4", "gama = 0.4"), encoding="utf-8")
    output = tmp_path / "generated"
    good = str(CONTROLLERS / "puma3.toml")
    assert main(["generate", good, str(bad), "--output", str(output)]) == 2
    assert 'did you mean "gamma"' in capsys.readouterr().err
    assert not output.exists()


def test_the_committed_schema_is_current_and_describes_every_key() -> None:
    text = json_schema()
    assert (CONTROLLERS / "specification.schema.json").read_text(encoding="utf-8") == text
    schema = json.loads(text)
    for table in (schema, *schema["$defs"].values()):
        for key, value in table["properties"].items():
            assert value.get("description") or "$ref" in value, key
