"""The claim on random plants: each statistic on tables whose answers are known, and the command."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from mpmath import mp, mpf
from scipy.integrate import solve_ivp
from scipy.stats import spearmanr

from plant.__main__ import main as fly
from verification.__main__ import main
from verification.claim import present
from verification.claim.figures import SafeMap, draw
from verification.claim.flown import LOST_DEG, VIBRATING, ClaimError, Flown, State, flown
from verification.claim.linear import joints_of, motor_bound, tick
from verification.claim.statistics import (
    RATIO_ROWS,
    Share,
    Spread,
    bands,
    best,
    rank_correlations,
    ratios,
    standing,
)
from verification.paper import table_2

ROOT = Path(__file__).parents[2]
ROWS = tuple(table_2())
LIMITS = (10.0, 20.0, 5.0)


def _table(plants: int = 4, rows: tuple[str, ...] = ROWS, **of_plant: list[Any]) -> pa.Table:
    """Runs whose errors are Table II's; plant k's are 1 + k times as large."""
    runs = [
        {
            "plant": k,
            "seed": 0,
            "gain_set": row,
            "friction_model": "lugre",
            "torque_delay_ticks": 0.0,
            "stiffness_factor": 1.0,
            **{name: values[k] for name, values in of_plant.items()},
            **{
                f"joint{j + 1}_{name}": value
                for j, rms in enumerate(table_2()[row].rms_deg)
                for name, value in (
                    ("rms_error_deg", (1 + k) * rms),
                    ("peak_error_deg", 2 * (1 + k) * rms),
                    ("rms_torque_step_Nm", 0.03 * LIMITS[j]),
                    ("inertia_factor", 0.5 + 0.1 * j),
                )
            },
        }
        for k in range(plants)
        for row in rows
    ]
    return pa.Table.from_pylist(runs)


def _changed(table: pa.Table, plant: int, row: str, **figures: float | None) -> pa.Table:
    """The table with other figures of one run."""
    runs = table.to_pylist()
    run = next(r for r in runs if (r["plant"], r["gain_set"]) == (plant, row))
    assert figures.keys() <= run.keys()
    run.update(figures)
    return pa.Table.from_pylist(runs, table.schema)


def _ended(table: pa.Table, plant: int, row: str) -> pa.Table:
    """The table with one run that ended early."""
    names = (n for n in table.column_names if re.search("error|step", n))
    return _changed(table, plant, row, **dict.fromkeys(names))


def _flown(table: pa.Table) -> Flown:
    return flown(table, LIMITS)


def test_plants_like_the_papers_robot_confirm_the_paper() -> None:
    found = standing(_flown(_table()))
    assert found.plants == 4
    assert {row.row: [s.count for s in row.best] for row in found.rows} == {
        row: [4 * (row == "Exp08")] * 3 for row in ROWS
    }
    assert found.whole.best_on_both.count == found.whole.fine.count == 4
    for spread in found.whole.correlation:
        assert spread.plants == 4
        assert spread.percentile_5 == pytest.approx(1.0)
    for row in found.rows:
        assert [s.median for s in row.ratio] == pytest.approx(row.paper_ratio)
    hsia = next(row for row in found.rows if row.row == "Exp01")
    assert hsia.paper_ratio == pytest.approx((13.9, 0.0377 / 0.0017, 0.0478 / 0.0017))


def test_the_best_row_is_counted_by_joint() -> None:
    table = _changed(_table(), 1, "Exp06", joint1_rms_error_deg=1e-5, joint3_rms_error_deg=1e-5)
    table = _changed(table, 2, "Exp05", joint2_rms_error_deg=1e-5)
    found = standing(_flown(table))
    assert [s.count for s in found.whole.best] == [3, 3, 3]
    assert found.whole.best_on_both.count == 2
    by_row = {row.row: [s.count for s in row.best] for row in found.rows}
    assert (by_row["Exp06"], by_row["Exp05"], by_row["Exp01"]) == ([1, 0, 1], [0, 1, 0], [0, 0, 0])


def test_a_run_that_ended_early_is_never_best_and_has_no_ratio() -> None:
    table = _ended(_ended(_table(), 0, "Exp08"), 3, "Exp01")
    for row in ROWS:
        table = _ended(table, 2, row)
    arrays = _flown(table)
    assert best(arrays).sum(axis=(1, 2)).tolist() == [3, 3, 0, 3]
    assert best(arrays)[0, ROWS.index("Exp06")].all()
    assert np.isnan(ratios(arrays, "Exp01")).all(axis=1).tolist() == [True, False, True, True]
    found = {row.row: row for row in standing(arrays).rows}
    assert found["Exp08"].diverged.count == 2
    assert found["Exp01"].ratio[0].plants == 1
    assert standing(arrays).whole.correlation[0].plants == 3


def test_states_are_told_by_the_worst_joint() -> None:
    table = _table(torque_delay_ticks=[0.0, 0.1, 0.2, 0.3])
    table = _changed(table, 1, "Exp08", joint2_rms_torque_step_Nm=1.01 * VIBRATING * LIMITS[1])
    table = _changed(table, 2, "Exp08", joint2_rms_torque_step_Nm=0.99 * VIBRATING * LIMITS[1])
    table = _changed(table, 3, "Exp08", joint3_peak_error_deg=1.01 * LOST_DEG)
    arrays = _flown(table)
    states = arrays.states[:, ROWS.index("Exp08")].tolist()
    assert states == [State.FINE, State.VIBRATING, State.FINE, State.DIVERGED]
    found = standing(arrays)
    by_delay = [g.fine.count for g in found.groups if g.by == "delay"]
    assert by_delay == [1, 0, 1, 0, 0]
    of_state = [g.plants for g in found.groups if g.by == "Exp08"]
    assert of_state == [2, 1, 1]


def test_groups_by_friction_hold_their_plants() -> None:
    table = _table(friction_model=["lugre", "dahl", "dahl", "coulomb-stribeck"])
    table = _changed(table, 2, "Exp06", joint1_rms_error_deg=1e-5)
    groups = {g.value: g for g in standing(_flown(table)).groups if g.by == "friction"}
    assert {name: g.plants for name, g in groups.items()} == {
        "lugre": 1,
        "dahl": 2,
        "coulomb-stribeck": 1,
    }
    assert groups["dahl"].best[0].count == 1
    assert groups["lugre"].best[0].count == 1


@pytest.mark.parametrize(("count", "of"), [(0, 30), (1, 30), (29, 30), (30, 30), (950, 1000)])
def test_intervals_are_those_of_clopper_and_pearson(count: int, of: int) -> None:
    """At its ends the counts beyond have a probability of 2.5 %, by the binomial sum itself."""
    share = Share.among(np.arange(of) < count)
    assert (share.count, share.of, share.share) == (count, of, count / of)
    with mp.workdps(40):

        def tail(p: float, counts: range) -> mpf:
            x = mpf(p)
            return mp.fsum(mp.binomial(of, k) * x**k * (1 - x) ** (of - k) for k in counts)

        if count > 0:
            assert float(tail(share.low, range(count, of + 1))) == pytest.approx(0.025, rel=1e-6)
        else:
            assert share.low == 0.0
        if count < of:
            assert float(tail(share.high, range(count + 1))) == pytest.approx(0.025, rel=1e-6)
        else:
            assert share.high == 1.0


def test_a_share_of_nothing_may_be_anything() -> None:
    share = Share.among(np.zeros(0, dtype=np.bool_))
    assert (share.of, share.low, share.high) == (0, 0.0, 1.0)
    assert np.isnan(share.share)


def test_spreads_leave_out_what_is_not_finite() -> None:
    values = np.array([np.inf, np.nan, *np.arange(101.0)])
    assert Spread.of(values) == Spread(101, 5.0, 50.0, 95.0)
    assert Spread.of(np.array([np.nan])).plants == 0


def test_rank_correlation_is_that_of_scipy() -> None:
    rng = np.random.default_rng(1904)
    table = _ended(_table(), 0, "Exp12")
    arrays = _flown(table)
    arrays.rms_deg[1:] = rng.random(arrays.rms_deg[1:].shape)
    found = rank_correlations(arrays)
    for k in range(4):
        for j in range(3):
            ours = np.nan_to_num(arrays.rms_deg[k, :, j], posinf=1e9)
            paper = [row.rms_deg[j] for row in table_2().values()]
            assert found[k, j] == pytest.approx(spearmanr(ours, paper).statistic, abs=1e-12)
    assert np.abs(found[1:]).max() < 0.9


def test_bands_of_the_map_tell_the_delays() -> None:
    table = _table(
        4,
        ("Exp01", "Exp08"),
        torque_delay_ticks=[0.1, 0.2, 0.3, 0.4],
        stiffness_factor=[5.0, 6.0, 7.0, 0.15],
    )
    table = _changed(table, 1, "Exp08", joint1_rms_torque_step_Nm=9.0)
    table = _ended(table, 2, "Exp08")
    found = {(b.row, round(b.stiffness_factor[1], 1)): b for b in bands(_flown(table))}
    assert len(found) == 12
    stiff = found["Exp08", 10.0]
    assert (stiff.plants, stiff.fine.count) == (3, 1)
    assert (stiff.last_fine, stiff.first_not_fine, stiff.first_diverged) == (0.1, 0.2, 0.3)
    soft = found["Exp08", 0.2]
    assert (soft.last_fine, soft.first_not_fine, soft.first_diverged) == (0.4, None, None)
    assert found["Exp08", 1.0].plants == 0
    assert found["Exp01", 10.0].fine.count == 3


def test_a_row_that_is_missing_is_told() -> None:
    with pytest.raises(ClaimError, match=r"no Exp13.*experiments and run make claim"):
        standing(_flown(_table(rows=ROWS[:-1])))


@pytest.mark.parametrize("cut", [slice(1, None), slice(0, -1), slice(0, 0)])
def test_a_table_with_holes_is_refused(cut: slice) -> None:
    table = _table()
    with pytest.raises(ClaimError, match="not one run of each gain set"):
        _flown(pa.Table.from_pylist(table.to_pylist()[cut], table.schema))


def test_a_table_with_several_seeds_is_refused() -> None:
    table = _table()
    with pytest.raises(ClaimError, match="leave seeds out"):
        _flown(pa.concat_tables([table, table]))


def test_pictures_have_the_same_bytes_every_time(tmp_path: Path) -> None:
    spread = {
        "torque_delay_ticks": [0.0, 0.1, 0.2, 0.3],
        "stiffness_factor": [0.1, 1.0, 2.0, 9.0],
    }
    arrays = _flown(_ended(_table(4, ROWS, **spread), 2, "Exp08"))
    safe = SafeMap(arrays, joints_of(MAP))
    campaigns = {"rigid": arrays, "flexible": arrays}
    standings = {name: standing(arrays) for name in campaigns}
    one, other = (draw(campaigns, standings, safe, tmp_path / name) for name in ("a", "b"))
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in other]
    text = (tmp_path / "a" / "safe_map.svg").read_text(encoding="utf-8")
    assert "fine: 3" in text
    assert "diverged: 1" in text


# --- Linear theory -----------------------------------------------------------------------------

MAP = ROOT / "plant" / "campaigns" / "safe_map.toml"


def test_a_tick_of_the_linear_loop_is_that_of_an_integration() -> None:
    joint, delay = joints_of(MAP)[2], 0.3
    rng = np.random.default_rng(4)
    state = rng.standard_normal(7) * np.array([1.0, 1e2, 1.0, 1e2, 1e4, 1.0, 1.0])
    theta, before, twice = state[0], state[5], state[6]
    L = joint.sample_time_s
    wanted = joint.kd_per_s * (theta - before) / L + joint.kp_per_s2 * theta
    torque = state[4] - joint.mbar_kgm2 * (wanted + (theta - 2 * before + twice) / L**2)

    def motion(_: float, x: Any, u: float) -> list[float]:
        spring = joint.stiffness_Nm_per_rad * (x[0] - x[2])
        spring += joint.damping_Nms_per_rad * (x[1] - x[3])
        return [x[1], (u - spring) / joint.rotor_kgm2, x[3], spring / joint.link_kgm2]

    x = state[:4]
    for u, duration in ((state[4], delay * L), (torque, (1 - delay) * L)):
        x = solve_ivp(motion, (0, duration), x, args=(u,), rtol=1e-11, atol=1e-9).y[:, -1]
    np.testing.assert_allclose(tick(joint, delay) @ state, [*x, torque, theta, before], rtol=1e-8)


@pytest.mark.parametrize("delay", [0.0, 0.2, 0.7])
def test_the_cubic_is_the_free_motors_loop(delay: float) -> None:
    joint = replace(
        joints_of(MAP)[0],
        stiffness_Nm_per_rad=0.0,
        damping_Nms_per_rad=0.0,
        kd_per_s=0.0,
        kp_per_s2=0.0,
    )
    r, c0, c2 = joint.mbar_kgm2 / joint.rotor_kgm2, (1 - delay) ** 2 / 2, delay**2 / 2
    roots = np.roots([1.0, r * c0 - 1.0, r * (1.0 - c0 - c2), r * c2])
    eigenvalues = np.linalg.eigvals(tick(joint, delay))
    for root in roots:
        assert np.abs(eigenvalues - root).min() < 1e-6


@pytest.mark.parametrize(("ratio", "delay"), [(1.99, 0.0), (2.01, 0.0), (0.5, 1.0)])
def test_without_delay_mbar_may_be_twice_the_inertia(ratio: float, delay: float) -> None:
    joint = replace(joints_of(MAP)[0], mbar_kgm2=ratio, rotor_kgm2=1.0)
    bound = motor_bound(joint)
    assert bound == delay if ratio != 1.99 else 0.0 < bound < 0.01


def test_the_bound_separates_growing_from_decaying_vibration() -> None:
    """The elbow flown tick by tick behind a soft spring, on either side of its bound."""
    joint = joints_of(MAP)[2]
    bound = motor_bound(joint)
    for delay, grows in ((bound - 0.03, False), (bound + 0.03, True)):
        state = np.array([1e-3, 0, 0, 0, 0, 1e-3, 1e-3])
        step, torques = tick(joint.stiffer(1e-3), delay), []
        for _ in range(400):
            state = step @ state
            torques.append(state[4])
        # Differences are free of the slow motion on the spring.
        vibration = np.abs(np.diff(torques, 3))
        assert bool(vibration[-50:].max() > vibration[:50].max()) is grows


# --- The command -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The campaigns' files with two or three plants and a motion of 0.6 s."""
    folder = tmp_path_factory.mktemp("campaigns")
    for name, count in (("claim_rigid", 3), ("claim_flexible", 2), ("safe_map", 2)):
        text = (ROOT / "plant" / "campaigns" / f"{name}.toml").read_text(encoding="utf-8")
        text = re.sub("(?m)^count = .*", f"count = {count}", text)
        text = re.sub("(?m)^amplitude_deg = .*", "amplitude_deg = [0.5, 1.5]", text)
        text = text.replace("../../controllers", str(ROOT / "controllers"))
        text = text.replace("[plants]", "speed = 20\n[plants]")
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    return folder


def test_the_command_says_what_to_run_first(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(present, "SPECIFICATIONS", small)
    assert main(["claim", "--results", str(tmp_path)]) == 2
    assert "no results of claim_rigid.toml: run make claim" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_campaigns_end_to_end(
    small: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in (*present.CAMPAIGNS.values(), present.SAFE_MAP):
        path, output = str(small / f"{name}.toml"), str(tmp_path / name)
        assert fly(["campaign", path, "--output", output, "--backend", "threading", "--json"]) == 0
    monkeypatch.setattr(present, "SPECIFICATIONS", small)
    monkeypatch.setattr(present, "PICTURES", tmp_path / "pictures")
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    capsys.readouterr()
    command = ["claim", "--results", str(tmp_path)]
    assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["evidence"] == "sampled"
    assert found["rigid"]["plants"] == 3
    assert [round(b["mbar_over_rotor"], 2) for b in found["linear"]] == [1.27, 1.01, 1.63]
    assert [row["row"] for row in found["flexible"]["rows"]] == list(ROWS)
    assert {band["row"] for band in found["safe_map"]} == {"Exp01", "Exp02", "Exp05", "Exp08"}
    assert sum(b["plants"] for b in found["safe_map"] if b["row"] == "Exp08") == 2
    assert len(list((tmp_path / "pictures").glob("*.svg"))) == 7
    assert main(command) == 0
    told = capsys.readouterr().out
    assert all(row in told for row in RATIO_ROWS)
    # More plants are specified than are flown.
    more = small / "claim_rigid.toml"
    more.write_text(more.read_text(encoding="utf-8").replace("count = 3", "count = 4"))
    assert main(command) == 2
    assert "3 of the 4 plants of claim_rigid.toml are flown: run make claim" in (
        capsys.readouterr().err
    )
    more.write_text(more.read_text(encoding="utf-8").replace("root_seed = 2017", "root_seed = 1"))
    assert main(command) == 2
    assert "differs in plants.root_seed" in capsys.readouterr().err
