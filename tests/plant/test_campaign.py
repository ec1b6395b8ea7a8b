"""Campaigns: the same rows whoever flies them, restarted without loss, wrong ones refused."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pyarrow.parquet as pq
import pytest
from distributed import LocalCluster
from joblib.externals.loky import get_reusable_executor

from codegen.problems import SpecificationError
from plant.__main__ import main
from plant.assembly import build_plant
from plant.campaign import execution, plants
from plant.campaign.execution import Workers, fly_missing
from plant.campaign.results import Folder, open_folder, schema
from plant.campaign.runs import Campaign, CampaignError, fly_plants, prepare
from plant.campaign.specification import PlantsTable, read
from plant.flight import fly
from plant.model import dynamics
from plant.robot import ROBOTS, FrictionName, load_robot

ROOT = Path(__file__).parents[2]
PUMA3 = ROOT / "controllers" / "puma3.toml"
RUNS = 6 * 2

SMALL = f"""
controller = "{PUMA3}"
experiments = ["Exp02", "Exp08"]
speed = 20

[plants]
count = 6
root_seed = 7
friction_models = ["lugre", "coulomb-stribeck"]
friction_factor = [0.5, 2.0]
inertia_factor = [0.9, 1.1]
torque_delay = [0.0, 0.5]
amplitude_deg = [0.5, 1.5]
encoder_phase = [0, 1]
"""
"""Runs of 0.6 s."""


def _file(folder: Path, text: str = SMALL) -> Path:
    path = folder / "small.toml"
    path.write_text(text, encoding="utf-8")
    return path


def _campaign(folder: Path, text: str = SMALL) -> Campaign:
    path = _file(folder, text)
    return prepare(read(path), path.parent)


def _fly(path: Path, output: Path, *options: str) -> int:
    return main(["campaign", str(path), "--output", str(output), "--jobs", "2", *options])


def _rows(output: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = pq.read_table(output / "results.parquet").to_pylist()
    return rows


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _file(tmp_path_factory.mktemp("campaign"))


@pytest.fixture(scope="module")
def campaign(spec: Path) -> Campaign:
    return prepare(read(spec), spec.parent)


@pytest.fixture(scope="module")
def whole(spec: Path) -> Path:
    """The folder of a campaign that was never interrupted, flown in threads."""
    output = spec.parent / "whole"
    assert _fly(spec, output, "--backend", "threading") == 0
    return output


def _results(output: Path) -> bytes:
    return (output / "results.parquet").read_bytes()


def test_processes_give_the_bits_of_threads(spec: Path, whole: Path, tmp_path: Path) -> None:
    assert _fly(spec, tmp_path, "--backend", "loky", "--batch", "1") == 0
    assert _results(tmp_path) == _results(whole)


def test_a_dask_cluster_gives_the_bits_of_threads(spec: Path, whole: Path, tmp_path: Path) -> None:
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
    ) as cluster:
        dask = ("--backend", "dask", "--scheduler", cluster.scheduler_address)
        assert _fly(spec, tmp_path, *dask, "--batch", "2") == 0
    assert _results(tmp_path) == _results(whole)


def test_dask_starts_processes_of_its_own_where_no_scheduler_is_named(
    spec: Path, whole: Path, tmp_path: Path
) -> None:
    assert _fly(spec, tmp_path, "--backend", "dask", "--batch", "3") == 0
    assert _results(tmp_path) == _results(whole)


def test_a_missing_scheduler_is_told(
    spec: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(execution, "_SCHEDULER_TIMEOUT_S", 0.2)
    assert _fly(spec, tmp_path, "--backend", "dask", "--scheduler", "tcp://127.0.0.1:9") == 2
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in capsys.readouterr().err
    assert _fly(spec, tmp_path, "--scheduler", "tcp://127.0.0.1:9") == 2
    assert "--scheduler: is for --backend dask" in capsys.readouterr().err


def test_a_row_does_not_depend_on_other_runs(campaign: Campaign, whole: Path) -> None:
    alone = fly_plants(campaign, range(4, 5))
    flown = [row for row in _rows(whole) if row["plant"] == 4]
    assert [{"reason": None} | row for row in alone] == flown


def test_without_random_plants_a_run_is_that_of_simulate(tmp_path: Path) -> None:
    text = SMALL.split("[plants]")[0] + "[plants]\ncount = 1\n"
    campaign = _campaign(tmp_path, text)
    for row, gain_set in zip(fly_plants(campaign, range(1)), campaign.gain_sets, strict=True):
        wanted = fly(PUMA3, experiment=gain_set, speed=20, backend="compiled").figures()
        assert (row["ticks"], row["saturated_ticks"]) == (600, wanted["saturated_ticks"])
        assert (row["friction_model"], row["amplitude_deg"]) == ("lugre", pytest.approx(40))
        for column, figure in (
            ("rms_error_deg", "rms_deg"),
            ("rms_true_error_deg", "rms_true_deg"),
            ("peak_error_deg", "peak_error_deg"),
            ("peak_torque_Nm", "peak_torque_Nm"),
            ("rms_torque_step_Nm", "rms_torque_step_Nm"),
        ):
            assert [row[f"joint{i}_{column}"] for i in (1, 2, 3)] == wanted[figure], column


def test_the_reference_backend_gives_the_same_figures(tmp_path: Path, whole: Path) -> None:
    campaign = _campaign(tmp_path, 'backend = "pinocchio"\n' + SMALL)
    # One plant of each friction model.
    compiled = _rows(whole)
    for model in campaign.robots:
        k = next(row["plant"] for row in compiled if row["friction_model"] == model)
        wanted = [row for row in compiled if row["plant"] == k]
        for row, other in zip(fly_plants(campaign, range(k, k + 1)), wanted, strict=True):
            for column, value in row.items():
                # Rounding errors move an encoder's edge by a tick now and then.
                exact = value is None or isinstance(value, str)
                same = value if exact else pytest.approx(value, rel=1e-2)
                assert other[column] == same, column


def test_rows_have_units_and_hashes(campaign: Campaign, whole: Path) -> None:
    table = pq.read_table(whole / "results.parquet")
    assert table.num_rows == RUNS
    assert table.schema.equals(schema(campaign), check_metadata=True)
    told = json.loads(table.schema.metadata[b"campaign"])
    assert told == json.loads((whole / "campaign.json").read_text(encoding="utf-8"))
    assert told["c_sha256"] == campaign.c_sha256
    assert told["inputs_sha256"] == campaign.inputs_sha256
    assert {row["gain_set"] for row in table.to_pylist()} == {"Exp02", "Exp08"}
    assert 0.0 < table["joint3_rms_error_deg"].to_numpy().max() < 0.2


def test_files_can_be_read_by_whoever_may_read_the_folder(whole: Path, tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.touch()
    assert {path.stat().st_mode for path in whole.iterdir()} == {plain.stat().st_mode}


def test_an_interrupted_campaign_goes_on_and_ends_with_the_same_bits(
    spec: Path,
    whole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    add, added = Folder.add, list[range]()

    def counted(folder: Folder, plants: range, rows: Any) -> None:
        if len(added) == 2:
            raise KeyboardInterrupt
        add(folder, plants, rows)
        added.append(plants)

    def told(folder: Folder, plants: range, rows: Any) -> None:
        added.append(plants)
        add(folder, plants, rows)

    options = ("--backend", "threading", "--batch", "1")
    monkeypatch.setattr(Folder, "add", counted)
    assert _fly(spec, tmp_path, *options) == 130
    assert "2 of 6 plants are finished" in capsys.readouterr().err
    assert not (tmp_path / "results.parquet").exists()
    finished = {i for plants in added for i in plants}
    added.clear()
    monkeypatch.setattr(Folder, "add", told)
    assert _fly(spec, tmp_path, *options) == 0
    assert {i for plants in added for i in plants} == set(range(6)) - finished
    assert _results(tmp_path) == _results(whole)
    added.clear()
    assert _fly(spec, tmp_path, *options) == 0
    assert added == [], "nothing is flown again"


def test_a_signal_leaves_whole_batches_and_says_how_to_go_on(tmp_path: Path) -> None:
    path = _file(tmp_path, SMALL.replace("count = 6", "count = 1000000"))
    command = [
        sys.executable,
        "-m",
        "plant",
        "campaign",
        str(path),
        "--output",
        str(tmp_path / "o"),
    ]
    process = subprocess.Popen(
        [*command, "--jobs", "2", "--batch", "4"],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A shell's background job, in which the tests may run, ignores the signal.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        deadline = time.monotonic() + 240
        while not list((tmp_path / "o").glob("plants-*")) and time.monotonic() < deadline:
            assert process.poll() is None
            time.sleep(0.05)
        # As a terminal does: to the workers, too.
        os.killpg(process.pid, signal.SIGINT)
        told = process.communicate(timeout=240)[1]
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130, told
    # A worker that loky has just started anew may tell of the signal first.
    assert re.search(r"Interrupted: \d+ of 1000000 .* the same command goes on .*\s*\Z", told)
    batches = list((tmp_path / "o").glob("plants-*"))
    assert batches
    assert {pq.read_table(path).num_rows for path in batches} == {8}
    assert list((tmp_path / "o").glob(".*")) == []


def test_more_plants_go_on_where_fewer_ended(whole: Path, spec: Path, tmp_path: Path) -> None:
    few = _file(tmp_path, SMALL.replace("count = 6", "count = 4"))
    output = tmp_path / "output"
    options = ("--backend", "threading", "--batch", "3")
    assert _fly(few, output, *options) == 0
    assert len(_rows(output)) == 8
    assert _fly(spec, output, *options) == 0
    assert _results(output) == _results(whole)
    assert sorted(p.name for p in output.glob("plants-*")) == [
        "plants-00000000-00000002.parquet",
        "plants-00000003-00000003.parquet",
        "plants-00000004-00000005.parquet",
    ]


def test_plants_that_were_flown_twice_are_told_once(
    campaign: Campaign, whole: Path, tmp_path: Path
) -> None:
    folder = open_folder(tmp_path, campaign)
    for batch in (range(2, 6), range(3, 5), range(0, 4)):
        folder.add(batch, fly_plants(campaign, batch))
    assert folder.missing(4) == []
    folder.finish()
    assert _results(tmp_path) == _results(whole)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("friction_factor = [0.5, 2.0]", "friction_factor = [0.5, 2.1]", "plants.friction_factor"),
        ("root_seed = 7", "root_seed = 8", "plants.root_seed"),
        ('["Exp02", "Exp08"]', '["Exp08"]', "experiments"),
    ],
)
def test_runs_of_another_specification_are_refused(
    old: str, new: str, told: str, whole: Path, tmp_path: Path
) -> None:
    with pytest.raises(CampaignError, match=f"differs in {told}: name another --output"):
        open_folder(whole, _campaign(tmp_path, SMALL.replace(old, new)))


def test_other_friction_of_the_robot_that_gives_it_is_another_campaign(tmp_path: Path) -> None:
    giver, robot = tmp_path / "giver.toml", tmp_path / "mine.toml"
    text = (ROBOTS / "reference.toml").read_text(encoding="utf-8")
    robot.write_text(
        'description = "d"\nbased_on = "reference"\nfriction_from = "giver.toml"\n',
        encoding="utf-8",
    )
    hashes = []
    for viscous in ("[5, 5, 3]", "[5, 5, 4]"):
        giver.write_text(
            text.replace(
                "viscous_Nms_per_rad = [5, 5, 3]", f"viscous_Nms_per_rad = {viscous}"
            ).replace('based_on = "puma560_akb"', f'based_on = "{ROBOTS}/puma560_akb.toml"'),
            encoding="utf-8",
        )
        named = SMALL.replace("[plants]", f'robot = "{robot}"\n[plants]', 1)
        hashes.append(_campaign(tmp_path, named).inputs_sha256)
    assert hashes[0] != hashes[1]


def test_runs_of_other_c_are_refused(campaign: Campaign, whole: Path, tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="differs in the controller's generated C"):
        open_folder(whole, replace(campaign, c_sha256="0"))
    with pytest.raises(CampaignError, match="differs in the C of the plant, or the compiler"):
        open_folder(whole, replace(campaign, libraries=("another.so",)))
    with pytest.raises(CampaignError, match="differs in the files of the controller or the robot"):
        open_folder(whole, replace(campaign, inputs_sha256="0"))
    (tmp_path / "letter.txt").touch()
    with pytest.raises(CampaignError, match="holds no campaign"):
        open_folder(tmp_path, campaign)


def test_a_worker_with_other_c_is_refused(campaign: Campaign) -> None:
    with pytest.raises(CampaignError, match="give it the same repository and compiler"):
        fly_plants(replace(campaign, libraries=("another.so",)), range(1))


def test_a_damaged_batch_is_told(spec: Path, tmp_path: Path) -> None:
    assert _fly(spec, tmp_path, "--backend", "threading", "--batch", "6") == 0
    batch = tmp_path / "plants-00000000-00000005.parquet"
    batch.write_bytes(batch.read_bytes()[:-10])
    assert _fly(spec, tmp_path, "--backend", "threading") == 2


def test_workers_compile_nothing(
    campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, compiler = tmp_path / "log", tmp_path / "cc"
    compiler.write_text(f'#!/bin/sh\necho called >>"{log}"\nexec cc "$@"\n', encoding="utf-8")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    # Another compiler is another library: one for each friction model, both made here.
    other = prepare(campaign.specification, tmp_path)
    assert log.read_text(encoding="utf-8").count("called") == 2
    get_reusable_executor().shutdown(wait=True)
    fly_missing(open_folder(tmp_path / "output", other), Workers("loky", 2), 1, progress=False)
    assert log.read_text(encoding="utf-8").count("called") == 2
    for name in other.libraries:
        (ROOT / "build" / "host" / name).unlink()


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("[0.5, 1.5]", "40", "the controller reported status -7 at tick"),
        ("[0.9, 1.1]", "3", "cannot hold its start posture"),
    ],
)
def test_a_run_that_does_not_reach_its_end_is_a_row(
    old: str, new: str, reason: str, tmp_path: Path
) -> None:
    path = _file(tmp_path, SMALL.replace(old, new))
    assert _fly(path, tmp_path / "output", "--backend", "threading", "--json") == 0
    rows = _rows(tmp_path / "output")
    assert len(rows) == RUNS
    lost = [row for row in rows if row["diverged"]]
    assert lost
    for row in lost:
        assert reason in row["reason"]
        assert row["ticks"] is None
        assert row["joint1_rms_error_deg"] is None


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("speed = 20", "sped = 20", 'sped = 20.*a known key: .*did you mean "speed"'),
        ("speed = 20", "speed = -1", "speed = -1.*greater than 0.*how many times as fast"),
        ("speed = 20", 'speed = "20"', 'speed = "20".*a valid number'),
        ('"Exp08"', '"Exp008"', r'experiments\[1\] = "Exp008".*one of .*did you mean "Exp08"'),
        ('"Exp08"', '"Exp02"', "experiments.*each name once.*remove the second Exp02"),
        ('["Exp02", "Exp08"]', "[]", "experiments.*a list of at least one name"),
        ("[0.5, 2.0]", "[2.0, 0.5]", r"plants.friction_factor.*lower end.*write \[0.5, 2\]"),
        ("[0.5, 2.0]", "0", "plants.friction_factor = 0.*greater than 0"),
        ("[0.5, 2.0]", "[1, 2, 3]", "a finite number, or two of them"),
        ("[0.0, 0.5]", "[0, 1.5]", "plants.torque_delay.*within 0 and 1"),
        ("count = 6", "", "plants.count.*needed.*how many plants"),
        ("count = 6", "count = 2.5", "plants.count = 2.5.*a valid integer"),
        ("lugre", "lugr", r'friction_models\[0\] = "lugr".*"dahl" or "coulomb-stribeck"'),
        ("[0.0, 0.5]", "[0, 0.5]\nstiffness_factor = [0, 2]", "stiffness_factor.*greater than 0"),
        (
            "[0.0, 0.5]",
            "[0, 0.5]\nstiffness_factor = [0.5, 2]",
            r"stiffness_factor = \[0.5, 2.0\].*\[flexibility\].*such as reference_flexible",
        ),
        ("[plants]", "[plants", "the file.*valid TOML"),
        ("puma3.toml", "puma9.toml", "puma9.toml"),
    ],
)
def test_a_wrong_specification_is_refused(
    old: str,
    new: str,
    told: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert old in SMALL
    path = _file(tmp_path, SMALL.replace(old, new))
    assert _fly(path, tmp_path / "output") == 2
    lines = capsys.readouterr().err.replace("\n", " ")
    assert re.search(told, lines), lines
    assert not (tmp_path / "output").exists()


def test_a_motion_beyond_the_range_of_a_joint_is_refused(tmp_path: Path) -> None:
    text = SMALL.replace("puma3.toml", "puma6.toml").replace("[0.5, 1.5]", "[1, 170]")
    with pytest.raises(
        SpecificationError,
        match=r"plants.amplitude_deg(.|\n)*stays within(.|\n)* smaller upper end",
    ):
        _campaign(tmp_path, text)


def test_there_must_be_a_file(tmp_path: Path) -> None:
    with pytest.raises(SpecificationError, match="No such file"):
        read(tmp_path / "none.toml")


def test_the_example_can_be_flown() -> None:
    path = ROOT / "plant" / "campaigns" / "random_plants.toml"
    campaign = prepare(read(path), path.parent)
    assert campaign.runs == 4000
    assert not any(row["diverged"] for row in fly_plants(campaign, range(1)))


TABLE = PlantsTable.model_validate(
    {
        "count": 1,
        "friction_factor": [0.5, 2.0],
        "inertia_factor": [0.9, 1.1],
        "torque_delay": [0.1, 0.2],
        "amplitude_deg": [5, 10],
        "encoder_phase": [0.25, 0.5],
        "stiffness_factor": [0.1, 10.0],
    }
)
MODELS: tuple[FrictionName, ...] = get_args(FrictionName)


def test_draws_fill_their_ranges_and_plants_differ() -> None:
    drawn = [plants.draw(TABLE, MODELS, 3, k) for k in range(200)]
    for values, (low, high) in (
        ([d.friction_factor for d in drawn], TABLE.friction_factor),
        ([d.inertia_factor for d in drawn], TABLE.inertia_factor),
        ([d.torque_delay for d in drawn], (0.1, 0.2)),
        ([d.amplitude_deg for d in drawn], (5.0, 10.0)),
        ([plants.encoder_phase(TABLE, 3, k, 0) for k in range(200)], (0.25, 0.5)),
    ):
        numbers = np.array(values)
        assert low <= numbers.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < numbers.max() <= high
        assert len(np.unique(numbers)) == numbers.size
    for name in MODELS:
        assert 45 < sum(d.friction_model == name for d in drawn) < 90
    # As many are stiffer than the geometric mean of the ends as are softer.
    factors = np.array([d.stiffness_factor for d in drawn])
    assert 0.1 <= factors.min() < 0.12
    assert 8.0 < factors.max() <= 10.0
    assert 80 < np.count_nonzero(factors > 1.0) < 120


def test_a_range_that_is_added_changes_no_other_number() -> None:
    without = TABLE.model_copy(update={"torque_delay": None, "amplitude_deg": None})
    drawn, other = (plants.draw(table, MODELS, 3, 5) for table in (TABLE, without))
    assert other.torque_delay is None
    np.testing.assert_array_equal(drawn.friction_factor, other.friction_factor)
    np.testing.assert_array_equal(drawn.inertia_factor, other.inertia_factor)


def test_plants_of_a_seed_stay_what_they_are() -> None:
    """Numbers that published campaigns were drawn with."""
    drawn = plants.draw(TABLE, MODELS, 3, 5)
    assert drawn.friction_factor == pytest.approx([1.63072032, 1.01735217, 1.65175571], abs=1e-8)
    assert drawn.inertia_factor == pytest.approx([0.99097942, 0.96007080, 1.01496474], abs=1e-8)
    assert drawn.torque_delay == pytest.approx(0.18461612, abs=1e-8)
    phase = plants.encoder_phase(TABLE, 3, 5, 0)
    assert phase == pytest.approx([0.44502644, 0.44664850, 0.27222117], abs=1e-8)


def test_seeds_change_the_phase_alone(tmp_path: Path) -> None:
    text = SMALL.replace("count = 6", "count = 1\nseeds = 2")
    rows = fly_plants(_campaign(tmp_path, text), range(1))
    assert [row["seed"] for row in rows] == [0, 0, 1, 1]
    numbers = ("factor", "delay", "amplitude", "model", "phase")
    changed = {key for key in rows[0] if rows[0][key] != rows[2][key]}
    assert {key for key in changed if any(word in key for word in numbers)} == {
        f"joint{i}_encoder_phase_counts" for i in (1, 2, 3)
    }
    assert rows[0]["joint1_rms_error_deg"] != rows[2]["joint1_rms_error_deg"]


@pytest.mark.parametrize("model", MODELS)
def test_friction_is_so_many_times_as_large(model: FrictionName) -> None:
    friction = load_robot("reference", friction=model).friction
    assert friction is not None
    times = np.array([0.5, 2.0, 3.0])
    more = plants.with_friction(friction, times)
    for velocity in ([0.1, -0.2, 0.3], [1e-5, -1e-4, 0.0]):
        arguments = ([0.1, 0.2, 0.3], velocity, [1e-5, -2e-5, 3e-5], 1e-4)
        nominal, scaled = friction.step(*arguments), more.step(*arguments)
        np.testing.assert_allclose(scaled.state, nominal.state, rtol=1e-12)
        np.testing.assert_allclose(scaled.torque_Nm, times * nominal.torque_Nm, rtol=1e-9)
        np.testing.assert_allclose(
            scaled.derivative_Nms_per_rad, times * nominal.derivative_Nms_per_rad, rtol=1e-9
        )


def test_springs_are_so_many_times_as_stiff_and_ring_as_long() -> None:
    springs = build_plant(load_robot("reference_flexible")).flexibility
    assert springs is not None
    stiff = plants.with_stiffness(springs, 4.0)
    assert stiff is not None
    np.testing.assert_allclose(stiff.stiffness_Nm_per_rad, [8e4, 8e4, 4e4])
    for inertia in (0.1, 1.0):
        ratio, other = (
            s.damping_Nms_per_rad / (2.0 * np.sqrt(s.stiffness_Nm_per_rad * inertia))
            for s in (springs, stiff)
        )
        np.testing.assert_allclose(ratio, other)
    assert plants.with_stiffness(None, 4.0) is None
    assert plants.with_stiffness(springs, None) is springs


def test_flexible_joints_are_flown_with_the_step_that_they_need(tmp_path: Path) -> None:
    stiff = tmp_path / "stiff.toml"
    stiff.write_text(
        f"""
description = "springs twice as stiff"
based_on = "reference_flexible"
[flexibility]
source = "a test"
stiffness_Nm_per_rad = [4e4, 4e4, 2e4]
damping_Nms_per_rad = [{math.sqrt(2) * 10}, {math.sqrt(2) * 10}, {math.sqrt(2) * 5}]
""",
        encoding="utf-8",
    )
    text = SMALL.split("[plants]")[0] + 'robot = "reference_flexible"\n[plants]\ncount = 1\n'
    for extra, factor, robot in (
        ("", None, "reference_flexible"),
        ("stiffness_factor = 2.0\n", 2.0, str(stiff)),
    ):
        row = fly_plants(_campaign(tmp_path, text + extra), range(1))[1]
        assert row["stiffness_factor"] == factor
        alone = fly(PUMA3, experiment="Exp08", speed=20, backend="compiled", robot=robot)
        assert [row[f"joint{i}_rms_error_deg"] for i in (1, 2, 3)] == alone.figures()["rms_deg"]


def test_links_are_so_many_times_as_heavy_and_motors_are_not() -> None:
    model = build_plant(load_robot("reference")).model
    heavy = plants.with_inertia(model, np.full(3, 1.5))
    q, qd, still = np.array([0.3, -0.8, 1.2]), np.array([0.5, -1.0, 2.0]), np.zeros(3)
    nominal, scaled = (dynamics(m, q, qd, still) for m in (model, heavy))
    motors = np.diag(model.armature)
    np.testing.assert_allclose(scaled.M - motors, 1.5 * (nominal.M - motors), rtol=1e-9)
    np.testing.assert_allclose(scaled.tau, 1.5 * nominal.tau, rtol=1e-9)


def test_a_motion_keeps_its_start_and_shape() -> None:
    motion = load_robot("reference").trajectory
    assert motion is not None
    assert plants.amplitude_deg(motion) == pytest.approx(40)
    smaller = plants.scaled(motion, 10)
    np.testing.assert_array_equal(smaller.start_rad, motion.start_rad)
    np.testing.assert_allclose(
        smaller.postures_rad - smaller.start_rad, 0.25 * (motion.postures_rad - motion.start_rad)
    )
