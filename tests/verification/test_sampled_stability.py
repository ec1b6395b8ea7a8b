"""The stable intervals of the sampled law against simulations, eigenvalues and the generated C."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pinocchio as pin
import pytest
from flint import fmpq_poly
from numpy.typing import NDArray

from codegen.controller import Controller, resolve
from codegen.law import AccelerationEstimate, VelocityError
from plant.assembly import Plant, at_rest
from plant.closed_loop import beginning, run_from, switch_on
from plant.controller import GeneratedController
from plant.drive import Drive
from plant.encoder import Encoder
from plant.friction import frictionless
from plant.trajectory import RestToRest
from verification import __main__ as command_line
from verification.sampled_stability import check
from verification.sampled_stability.intervals import (
    End,
    analyse,
    certificate,
    containing,
    cut,
    stable_intervals,
)
from verification.sampled_stability.loop import (
    Characteristic,
    Loop,
    LoopError,
    State,
    low_pass_ratio,
    sample,
)

Floats = NDArray[np.float64]

PAPER = Loop(Fraction(20), Fraction(100), Fraction(20), Fraction(1, 1000))
HSIA = replace(PAPER, lambda_=Fraction(0))
LOOPS = (
    PAPER,
    HSIA,
    replace(PAPER, acceleration="delayed"),
    replace(PAPER, compute_delay=1),
    replace(HSIA, acceleration="delayed", compute_delay=1),
    replace(PAPER, torque_delay=Fraction(1, 3), velocity_error="half-sample"),
    replace(PAPER, acceleration="delayed", compute_delay=1, torque_delay=Fraction(1, 4)),
    replace(PAPER, torque_delay=Fraction(1, 2), reports_torque=True),
    replace(PAPER, low_pass_ratio=Fraction(1, 3), velocity_error="error-difference"),
)


def ends(loop: Loop) -> tuple[float, float]:
    (interval,) = stable_intervals(loop)
    return float(interval.low), float(interval.high)


# A second implementation in double, by the difference equations as the paper writes them


class Joint:
    """M qdd = tau with M = 1, and the law (31) with reference 0."""

    def __init__(self, loop: Loop, r: float, state: Floats) -> None:
        self.loop, self.r = loop, r
        self.q, self.v = list(state[:4]), state[4]  # latest position first
        self.tau, self.integral = list(state[5:8]), state[8]

    @property
    def state(self) -> Floats:
        """In the order of ``State.vector``."""
        return np.array([*self.q, self.v, *self.tau, self.integral])

    def tick(self) -> None:
        """One sample."""
        loop, L, d = self.loop, float(self.loop.sample_time_s), float(self.loop.torque_delay)
        kd, kp, correction = float(loop.kd), float(loop.kp), float(loop.lambda_)
        q, c = self.q, loop.compute_delay
        e, ed = -q[0], -(q[0] - q[1]) / L
        back = q[1:] if loop.acceleration == "delayed" else q
        qdd = (back[0] - 2 * back[1] + back[2]) / L**2
        last = (1 - d) * self.tau[c] + d * self.tau[c + 1] if loop.reports_torque else self.tau[0]
        wanted = kd * ed + kp * e
        tau = self.r * (wanted + correction * (ed + self.integral)) + last - self.r * qdd
        if loop.low_pass_ratio is not None:
            tau = last + float(loop.low_pass_ratio) * (tau - last)
        self.integral += L * wanted
        self.tau = [tau, *self.tau[:2], self.tau[2]]
        # Motion under constant torque, first with the older command, then with the newer one.
        position = q[0]
        for torque, time in ((self.tau[c + 1], d * L), (self.tau[c], (1 - d) * L)):
            position += time * self.v + torque * time**2 / 2
            self.v += torque * time
        self.tau = self.tau[:3]
        self.q = [position, *q[:3]]


def growth(loop: Loop, r: float, ticks: int) -> float:
    """Largest position in the last sixth of a run, over that in the third sixth."""
    joint = Joint(loop, r, np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    moved = []
    for _ in range(ticks):
        joint.tick()
        moved.append(abs(joint.q[0]))
    sixth = ticks // 6
    return float(max(moved[5 * sixth :]) / max(moved[2 * sixth : 3 * sixth]))


def spectral_radius(loop: Loop, r: float) -> float:
    size = 9 if loop.lambda_ else 8  # with lambda = 0 the integral is no part of the loop
    columns = []
    for k in range(size):
        joint = Joint(loop, r, np.eye(9)[k])
        joint.tick()
        columns.append(joint.state[:size])
    return float(max(abs(np.linalg.eigvals(np.array(columns).T))))


def test_the_two_implementations_step_alike() -> None:
    rng = np.random.default_rng(5)
    for loop in LOOPS:
        state = rng.standard_normal(9)
        exact = sample(loop, Fraction(3, 10), State.of(tuple(map(Fraction, state.tolist()))))
        joint = Joint(loop, 0.3, state)
        joint.tick()
        np.testing.assert_allclose(np.array(exact.vector, dtype=float), joint.state, rtol=1e-9)


def test_a_sample_is_linear() -> None:
    """What makes unit vectors enough: the law's signs, powers and limits cancel out."""
    rng = np.random.default_rng(6)
    for loop in LOOPS:
        x, y = (tuple(map(Fraction, rng.standard_normal(9).tolist())) for _ in range(2))
        mixed = State.of(tuple(3 * a - b / 7 for a, b in zip(x, y, strict=True)))
        fx, fy = (sample(loop, Fraction(2), State.of(v)).vector for v in (x, y))
        assert sample(loop, Fraction(2), mixed).vector == tuple(
            3 * a - b / 7 for a, b in zip(fx, fy, strict=True)
        )


@pytest.mark.parametrize("loop", LOOPS)
def test_motions_die_out_inside_and_grow_outside(loop: Loop) -> None:
    low, high = ends(loop)
    assert growth(loop, 1.06 * low, 9000) < 0.8
    assert growth(loop, 0.94 * low, 9000) > 1.2
    assert growth(loop, 0.99 * high, 3000) < 0.9
    assert growth(loop, 1.01 * high, 3000) > 1.5


def test_eigenvalues_agree_at_random_ratios() -> None:
    rng = np.random.default_rng(7)
    inside = 0
    for loop in LOOPS:
        low, high = ends(loop)
        for r in np.exp(rng.uniform(np.log(0.2 * low), np.log(3 * high), 60)).tolist():
            if min(abs(r / low - 1), abs(r / high - 1)) > 1e-3:
                inside += low < r < high
                assert (spectral_radius(loop, r) < 1) == (low < r < high), (loop, r)
    assert inside > 100


@pytest.mark.parametrize("loop", LOOPS)
def test_the_ends_are_where_an_eigenvalue_reaches_the_circle(loop: Loop) -> None:
    low, high = ends(loop)
    for end, stable, unstable in ((low, 1 + 1e-4, 1 - 1e-4), (high, 1 - 1e-6, 1 + 1e-6)):
        assert spectral_radius(loop, end * stable) < 1 < spectral_radius(loop, end * unstable)


# Known figures


@pytest.mark.parametrize(
    ("loop", "low", "high"),
    [
        # From a study of its own, by Hurwitz determinants; lambda = 0.
        (HSIA, 0.00503, 1.96030),
        (replace(HSIA, compute_delay=1), 0.00513, 0.80594),
        (replace(HSIA, acceleration="delayed"), 0.00500, 0.80299),
        (replace(HSIA, acceleration="delayed", compute_delay=1), 0.00510, 0.51186),
    ],
)
def test_known_intervals(loop: Loop, low: float, high: float) -> None:
    np.testing.assert_allclose(ends(loop), (low, high), atol=6e-6)


def test_fast_sampling_leaves_only_the_lower_end_of_continuous_time() -> None:
    # Continuous time: M qddd = (Mbar/L)(qdd + KD qd + KP q) is Hurwitz iff Mbar/M > L KP/KD.
    fast = replace(HSIA, sample_time_s=Fraction(1, 10**6))
    low, high = ends(fast)
    assert low == pytest.approx(1e-6 * 100 / 20, rel=1e-4)
    # The upper end is then that of the acceleration alone: 2z^2 - (2 - r) z + r is Schur iff r < 2.
    assert high == pytest.approx(2, rel=1e-4)
    assert ends(HSIA)[1] < high


def test_a_whole_torque_delay_is_a_compute_delay() -> None:
    for acceleration in get_args(AccelerationEstimate):
        loop = replace(PAPER, acceleration=acceleration)
        assert ends(replace(loop, torque_delay=Fraction(1))) == ends(replace(loop, compute_delay=1))


def test_the_velocity_error_is_formed_differently_in_the_reference_alone() -> None:
    polynomials = [
        analyse(replace(PAPER, velocity_error=mode)).characteristic
        for mode in get_args(VelocityError)
    ]
    assert all(p == polynomials[0] for p in polynomials)


def test_the_low_pass_is_a_smaller_inertia() -> None:
    # (44)
    ratio = low_pass_ratio(Fraction(500), PAPER.sample_time_s)
    low, high = ends(PAPER)
    filtered = ends(replace(PAPER, low_pass_ratio=ratio))
    np.testing.assert_allclose(filtered, (3 * low, 3 * high), rtol=1e-12)
    assert ratio == resolve(specification(1.0, low_pass_rad_per_s=500)).low_pass_ratio


@pytest.mark.parametrize(
    "loop",
    [
        replace(PAPER, sample_time_s=Fraction(1, 100), compute_delay=1),
        replace(PAPER, kp=Fraction(0)),
        # Torques of alternating sign move no sampled position, and the report hands them on.
        replace(PAPER, compute_delay=1, reports_torque=True),
        replace(HSIA, torque_delay=Fraction(1), reports_torque=True),
    ],
)
def test_where_no_ratio_is_stable(loop: Loop) -> None:
    assert stable_intervals(loop) == ()
    assert list(check.complaints(certificate(analyse(loop)))) == []
    for r in np.geomspace(1e-4, 10, 60).tolist():
        assert spectral_radius(loop, r) > 1 - 1e-9


def test_every_kind_of_cut_is_found() -> None:
    """Polynomials that are no loop's: several intervals, one from zero, ends at z = 1 and -1."""
    rng = np.random.default_rng(8)
    counts, from_zero = set(), False
    for _ in range(300):
        constant = [*rng.integers(-9, 10, 4).tolist(), 10]
        ratio = rng.integers(-9, 10, 4).tolist()
        scale = fmpq_poly([1]) / 10
        polynomial = Characteristic(fmpq_poly(constant) * scale, fmpq_poly(ratio) * scale)
        if polynomial.ratio.is_zero():
            continue
        found, cells = cut(polynomial)
        counts.add(sum(cell.stable for cell in cells))
        from_zero |= cells[0].stable
        edges = [0.0, *map(float, found)]
        for low, high, cell in zip(edges, [*edges[1:], edges[-1] + 2], cells, strict=True):
            for r in np.linspace(low, high, 7)[1:-1].tolist():
                roots = np.roots((np.array([*ratio, 0]) * r + constant)[::-1])
                radius = max(abs(roots))
                assert (radius < 1) == cell.stable or abs(radius - 1) < 1e-6
    assert counts >= {0, 1, 2}
    assert from_zero


@pytest.mark.parametrize("e", [Fraction(1, 10**14), Fraction(32, 10**14)])
def test_zeros_that_are_almost_one_are_kept_apart(e: Fraction) -> None:
    # z^2 - z + c with p(1) = 0 at r = 1, p(-1) = 0 at r = 1 + e and c = 1 at r = 1 - e/2.
    k = int(2 / e)
    polynomial = Characteristic(fmpq_poly([k, -1, 1]), fmpq_poly([-k]))
    found, _ = cut(polynomial)
    offsets = [float((end.below + end.above) / 2 - 1) for end in found]
    np.testing.assert_allclose(offsets, [float(-e / 2), 0.0, float(e)], atol=1e-20)
    edges = [x for end in found for x in (end.below, end.above)]
    assert edges == sorted(set(edges))


# Exact ends


def test_ends_are_enclosed_and_compared_exactly() -> None:
    (interval,) = stable_intervals(PAPER)
    for end in (interval.low, interval.high):
        assert 0 < end.above - end.below < Fraction(1, 10**12)
        inside = end.below + (end.above - end.below) / 3
        assert [end.side(x) for x in (end.below, end.above)] == [-1, 1]
        assert end.side(inside) in (-1, 1)
    two = End(Fraction(1), Fraction(3), fmpq_poly([-2, 1]))
    assert [two.side(Fraction(x, 2)) for x in (1, 3, 4, 5, 7)] == [-1, -1, 0, 1, 1]
    root = End(Fraction(1), Fraction(2), fmpq_poly([-2, 0, 1]))
    assert [root.side(Fraction(x, 10**6)) for x in (1414213, 1414214)] == [-1, 1]


def test_a_range_of_ratios_and_its_margin() -> None:
    intervals = stable_intervals(PAPER)
    (interval,) = intervals
    low, high = Fraction(1, 2), Fraction(3, 2)
    margin = interval.margin(low, high)
    assert margin is not None
    assert margin.down == pytest.approx(2 * ends(PAPER)[0])
    assert margin.up == pytest.approx(ends(PAPER)[1] / 1.5)
    assert interval.contains(low * margin.down, high * margin.up)
    assert containing(intervals, low, high) is interval
    for outside in (
        (low, Fraction(193, 100)),
        (Fraction(1, 100), high),
        (low, interval.high.above),
        (interval.low.below, high),
        (high, low),
    ):
        assert not interval.contains(*outside)
        assert interval.margin(*outside) is None
        assert containing(intervals, *outside) is None


# Certificate


@pytest.mark.parametrize("acceleration", get_args(AccelerationEstimate))
def test_every_certificate_is_verified(acceleration: AccelerationEstimate) -> None:
    for lambda_, delay, part, reports, ratio, step in product(
        (0, 20), (0, 1), ("0", "1/3", "1"), (False, True), (None, Fraction(1, 3)), (100, 1000)
    ):
        loop = replace(
            PAPER,
            acceleration=acceleration,
            lambda_=Fraction(lambda_),
            sample_time_s=Fraction(1, step),
            compute_delay=delay,
            torque_delay=Fraction(part),
            low_pass_ratio=ratio,
            reports_torque=reports,
        )
        assert list(check.complaints(certificate(analyse(loop)))) == [], loop


def _shifted(text: str, by: Fraction) -> str:
    return str(Fraction(text) + by)


def damaged(good: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Certificates with one thing wrong, by what was done."""

    def made(what: str, change: Callable[[dict[str, Any]], None]) -> tuple[str, dict[str, Any]]:
        bad = copy.deepcopy(good)
        change(bad)
        assert bad != good, what
        return what, bad

    def put(path: tuple[Any, ...], value: Any) -> tuple[str, dict[str, Any]]:
        def change(bad: Any) -> None:
            for key in path[:-1]:
                bad = bad[key]
            bad[path[-1]] = value

        return made(f"{path} = {value}", change)

    loop = good["loop"]
    for key in ("kd", "kp", "lambda", "sample_time_s"):
        for factor in (Fraction(1001, 1000), Fraction(0), Fraction(-1)):
            yield put(("loop", key), str(Fraction(loop[key]) * factor))
        yield put(("loop", key), float(Fraction(loop[key])))
    other = {"current": "delayed", "delayed": "current"}[loop["acceleration"]]
    yield put(("loop", "acceleration"), other)
    yield put(("loop", "acceleration"), "none")
    yield put(("loop", "velocity_error"), "none")
    yield put(("loop", "compute_delay"), 1 - loop["compute_delay"])
    yield put(("loop", "compute_delay"), 2)
    yield put(("loop", "torque_delay"), _shifted(loop["torque_delay"], Fraction(1, 10**6)))
    yield put(("loop", "torque_delay"), "2")
    yield put(("loop", "low_pass_ratio"), "1/2")
    if loop["compute_delay"] or loop["torque_delay"] != "0":  # otherwise it says the same
        yield put(("loop", "reports_torque"), not loop["reports_torque"])
    yield put(("loop", "reports_torque"), None)
    yield put(("loop", "kc"), "0")
    for key in loop:
        yield made(f"no {key}", lambda bad, key=key: bad["loop"].pop(key))  # type: ignore[misc]
    for name, coefficients in good["characteristic"].items():
        for k, c in enumerate(coefficients):
            changed = _shifted(c, Fraction(1, 10**9))
            yield put(("characteristic", name, k), changed)
        yield made(
            f"longer {name}",
            lambda bad, name=name: bad["characteristic"][name].append("1"),  # type: ignore[misc]
        )
    for k, boundary in enumerate(good["boundaries"]):
        of_interval = any(boundary in interval for interval in good["intervals"])
        for shift in (Fraction(1, 10**9), Fraction(-1, 10**9)):
            if not of_interval:  # a zero of B between unstable cells; nothing is claimed of it
                break
            moved = [_shifted(end, shift) for end in boundary]

            def move(bad: Any, k: int = k, moved: list[str] = moved) -> None:
                text = json.dumps(bad).replace(json.dumps(good["boundaries"][k]), json.dumps(moved))
                bad.clear()
                bad.update(json.loads(text))

            yield made(f"boundary {k} moved by {float(shift)}", move)
        wide = [_shifted(boundary[0], Fraction(-1, 10**6)), boundary[1]]
        yield put(("boundaries", k), wide)
        yield put(("boundaries", k), boundary[::-1])
        yield made(f"no boundary {k}", lambda bad, k=k: bad["boundaries"].pop(k))  # type: ignore[misc]

        def forget(bad: Any, k: int = k) -> None:
            bad["boundaries"].pop(k)
            bad["cells"].pop(k)
            bad["intervals"] = []

        yield made(f"boundary {k} forgotten with its cell", forget)
    for k, cell in enumerate(good["cells"]):
        yield put(("cells", k, "stable"), not cell["stable"])
        yield put(("cells", k, "stable"), None)
        for test in ("0", "-1", "3/2", "7", "1/1000"):
            place = [float(Fraction(b[0])) for b in good["boundaries"]]
            if sum(b < Fraction(test) for b in place) != k or Fraction(test) <= 0:
                yield put(("cells", k, "test"), test)
        yield made(f"no cell {k}", lambda bad, k=k: bad["cells"].pop(k))  # type: ignore[misc]
    for k in range(len(good["intervals"])):
        for end, side in product((0, 1), (0, 1)):
            moved_end = _shifted(good["intervals"][k][end][side], Fraction(1, 10**14))
            yield put(("intervals", k, end, side), moved_end)
        yield put(("intervals", k), [["0", "0"], ["2", "2"]])

    def invent_a_gap(bad: Any) -> None:
        k = next(k for k, cell in enumerate(bad["cells"]) if cell["stable"])
        test = Fraction(bad["cells"][k]["test"])
        gap = [str(test + Fraction(j, 10**10)) for j in (1, 2)]
        bad["boundaries"].insert(k, gap)
        bad["cells"].insert(k + 1, {"test": str(test + Fraction(1, 10**8)), "stable": True})
        (low, high), *others = bad["intervals"]
        bad["intervals"] = [[low, gap], [gap, high], *others]

    yield made("a gap where there is none", invent_a_gap)
    yield put(("intervals",), [])
    yield put(("intervals",), good["intervals"] * 2)
    yield put(("evidence",), "proved")
    for key in good:
        yield made(f"no {key}", lambda bad, key=key: bad.pop(key))  # type: ignore[misc]
        yield put((key,), None)


@pytest.mark.parametrize("loop", [PAPER, LOOPS[6]])
def test_no_damaged_certificate_is_verified(loop: Loop) -> None:
    good = json.loads(json.dumps(certificate(analyse(loop))))
    assert list(check.complaints(good)) == []
    mutations = list(damaged(good))
    assert len(mutations) >= 100
    for what, bad in mutations:
        assert list(check.complaints(bad)) != [], what


def test_a_shift_of_the_velocity_error_is_no_damage() -> None:
    good = certificate(analyse(PAPER))
    good["loop"]["velocity_error"] = "half-sample"
    assert list(check.complaints(good)) == []


# Command


ARGUMENTS = ["--kd", "20", "--kp", "100", "--lambda", "20", "--sample-time"]


def run(*arguments: str) -> int:
    return command_line.main(["sampled-interval", *arguments])


def test_the_command_tells_and_leaves_the_interval(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    file = tmp_path / "certificate.json"
    assert run(*ARGUMENTS, "0.001", "--json", "--certificate", str(file)) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((tmp_path / "sampled_interval.json").read_text())
    assert told["intervals"] == [list(ends(PAPER))]
    assert told["evidence"] == "proved"
    # Half of the sampling frequency is the highest that there is.
    assert told["oscillation_Hz"] == [[pytest.approx(3.6, abs=0.1), pytest.approx(247, abs=1)]]
    assert json.loads(file.read_text()) == told["certificate"] == certificate(analyse(PAPER))
    assert check.main([str(file)]) == 0
    assert "verified" in capsys.readouterr().out
    assert run(*ARGUMENTS, "1/1000") == 0
    shown = " ".join(capsys.readouterr().out.split())
    for part in ("0.0140755862", "1.9218489912", "3.59 Hz", "247 Hz", "(0, 2)", "proved"):
        assert part in shown
    # Rounded inward: 1.92185 would be outside.
    assert "Mbar between 0.0140756 M and 1.92184 M" in shown


def test_options_reach_the_loop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    told = {}
    for words, loop in (
        (["--acceleration", "delayed"], replace(PAPER, acceleration="delayed")),
        (["--compute-delay", "1"], replace(PAPER, compute_delay=1)),
        (["--torque-delay", "1/4"], replace(PAPER, torque_delay=Fraction(1, 4))),
        (
            ["--torque-delay", ".25".zfill(4), "--reports-torque"],
            replace(PAPER, torque_delay=Fraction(1, 4), reports_torque=True),
        ),
        (["--low-pass", "1/3"], replace(PAPER, low_pass_ratio=Fraction(1, 3))),
        (["--low-pass", "500rad/s"], replace(PAPER, low_pass_ratio=Fraction(1, 3))),
        (["--velocity-error", "half-sample"], replace(PAPER, velocity_error="half-sample")),
    ):
        assert run(*ARGUMENTS, "1/1000", *words, "--json") == 0
        told = json.loads(capsys.readouterr().out)
        assert told["certificate"] == certificate(analyse(loop))
    assert run(*ARGUMENTS, "1/100", "--compute-delay", "1") == 0
    assert "none" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--kd", "-1"], "KD = -1"),
        (["--kp", "x"], "a number such as"),
        (["--kp", "1/0"], "a number such as"),
        (["--kp", "1e999999999"], "a number such as"),
        (["--kp", "nan"], "a number such as"),
        (["--sample-time", "0"], "sample time = 0"),
        (["--sample-time", "1000"], "write it in seconds"),
        (["--torque-delay", "3/2"], "torque delay = 3/2"),
        (["--compute-delay", "2"], "invalid choice"),
        (["--acceleration", "true"], "invalid choice"),
        (["--low-pass", "500"], "give a cutoff w with its unit"),
        (["--low-pass", "0rad/s"], "cutoff = 0"),
        (["--certificate", "/nowhere/c.json"], "choose a file in a folder that exists"),
    ],
)
def test_bad_input_is_refused(
    words: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        status = run(*ARGUMENTS, "1/1000", *words)
    except SystemExit as stop:
        status = int(stop.code or 0)
    assert status == 2
    error = capsys.readouterr().err
    assert says in error
    assert "Traceback" not in error


def test_a_certificate_that_is_not_verified_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    monkeypatch.setattr(
        "verification.sampled_stability.command.complaints", lambda _: ["something [is] wrong"]
    )
    assert run(*ARGUMENTS, "1/1000") == 1
    assert "something [is] wrong" in capsys.readouterr().out


def test_the_checker_says_what_it_makes_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "bad.json"
    bad = certificate(analyse(PAPER))
    bad["intervals"] = []
    file.write_text(json.dumps(bad))
    assert check.main([str(file)]) == 1
    assert "NOT verified" in capsys.readouterr().out
    file.write_text("{")
    assert check.main([str(file)]) == check.main([str(tmp_path / "none")]) == check.main([]) == 2


def test_loops_that_cannot_be() -> None:
    with pytest.raises(LoopError, match="velocity error"):
        replace(PAPER, velocity_error="none")  # type: ignore[arg-type]
    with pytest.raises(LoopError, match="acceleration"):
        replace(PAPER, acceleration="none")  # type: ignore[arg-type]
    with pytest.raises(LoopError, match="compute delay"):
        replace(PAPER, compute_delay=2)


# The generated C


COUNTS_PER_REV = 4_000_000_000
"""Of a fine encoder: the resolution is 1.6e-9 rad."""


def specification(inertia: float, **law: Any) -> dict[str, Any]:
    return {
        "name": "one_joint",
        "description": "one joint with the linear law",
        "precision": "float64",
        "joint_names": ["joint"],
        "sample_time_s": "1/1000",
        "law": {
            "inertia_kgm2": inertia,
            **{"kd": 20, "kp": 100, "lambda": 20, "alpha": 1, "beta": 1, "gamma": 1},
            **law,
        },
        "encoder": {"counts_per_rev": COUNTS_PER_REV, "gear_ratio": 1},
        "drive": {"torque_limit_Nm": 10**6},
        "safety": {"max_speed_rad_per_s": 1000},
    }


def flown(
    controller: Controller, delay: float, start_rad: float, ticks: int, substep_s: float
) -> Floats:
    """Positions of a frictionless joint with M = 1 kg m^2 about a vertical axis."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    encoder = Encoder.on_shaft(np.ones(1), np.array([float(COUNTS_PER_REV)]))
    plant = Plant("joint", model, frictionless(1), Drive(np.array([1e6]), delay), encoder)
    rest = RestToRest(np.zeros((2, 1)), np.array([ticks / 1000]))
    begin = beginning(plant, rest, 1e-3)
    begin = replace(begin, state=at_rest(plant, np.array([start_rad])))
    generated = GeneratedController(controller)
    switch_on(generated, begin)
    positions: Floats = run_from(plant, generated, begin, 1e-3, substep_s, progress=False).q[:, 0]
    return positions


@pytest.mark.parametrize(
    ("acceleration", "delay", "upper", "factor", "ticks", "substep_s"),
    [
        ("current", 0, True, 0.97, 600, 1e-5),
        ("current", 0, True, 1.03, 600, 1e-5),
        ("delayed", 1, True, 0.97, 600, 1e-5),
        ("delayed", 1, True, 1.03, 600, 1e-5),
        ("current", 0, False, 0.9, 6000, 2e-4),
        ("current", 0, False, 1.1, 6000, 2e-4),
    ],
)
def test_the_generated_c_in_closed_loop(
    acceleration: AccelerationEstimate,
    delay: int,
    upper: bool,
    factor: float,
    ticks: int,
    substep_s: float,
) -> None:
    """Beside the ends, further away from them than the error of the plant's integrator."""
    end = ends(replace(PAPER, acceleration=acceleration, compute_delay=delay))[upper]
    controller = resolve(specification(factor * end, acceleration=acceleration))
    # Far above the encoder's resolution, far below what the C's error can hold.
    q = flown(controller, float(delay), 1e-3 if upper else 1e-4, ticks, substep_s)
    # The vibration at the upper end stands out of the slow motion in the second difference.
    motion = np.abs(np.diff(q, 2) if upper else q)
    sixth = ticks // 6
    grown = motion[5 * sixth :].max() / motion[2 * sixth : 3 * sixth].max()
    assert (grown < 0.8) if (factor < 1) == upper else (grown > 1.25), grown
