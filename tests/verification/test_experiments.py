"""The closed-loop suite: the compiled C on the simulated plant, beside Table II."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from verification.evidence import Evidence
from verification.experiments import (
    FASTER,
    FIGURE_5,
    SIX_JOINTS,
    TABLE,
    Experiment,
    Outcome,
    beside_the_paper,
    conduct,
    conduct_all,
    improvements,
    rank_correlation,
    reversal_peaks_deg,
    reversal_times_s,
)

pytestmark = pytest.mark.closed_loop

Outcomes = Mapping[Experiment, Outcome]


def test_exp08_is_within_a_factor_two_of_the_paper_on_each_joint(outcomes: Outcomes) -> None:
    row = next(r for r in beside_the_paper(outcomes) if r.experiment == "Exp08")
    assert all(0.5 <= ratio <= 2.0 for ratio in row.ratio), row.ratio


def test_exp08_is_eight_times_better_than_hsia_on_each_joint(outcomes: Outcomes) -> None:
    gain = next(g for g in improvements(beside_the_paper(outcomes)) if g.experiment == "Exp01")
    assert min(gain.ours) >= 8.0, gain.ours


def test_the_four_rows_come_in_the_papers_order(outcomes: Outcomes) -> None:
    rows = beside_the_paper(outcomes)
    assert [r.experiment for r in rows] == ["Exp01", "Exp02", "Exp05", "Exp08"]
    for joint in range(3):
        ours = [row.ours_deg[joint] for row in rows]
        assert ours == sorted(ours, reverse=True)


def test_ratios_between_rows_are_near_the_papers(outcomes: Outcomes) -> None:
    for gain in improvements(beside_the_paper(outcomes)):
        for ours, paper in zip(gain.ours, gain.paper, strict=True):
            assert paper / 2.0 <= ours <= 2.0 * paper, gain


def test_no_tick_saturates_or_fails(outcomes: Outcomes) -> None:
    for outcome in outcomes.values():
        assert outcome.figures["saturated_ticks"] == 0
        assert (outcome.run.status == 0).all()
        assert (np.abs(outcome.run.torque_applied_Nm) < outcome.torque_limit_Nm).all()


def test_half_as_fast_again_stays_below_a_factor_two_of_the_paper(outcomes: Outcomes) -> None:
    paper = (0.0017, 0.0025, 0.0030)
    ratios = [a / b for a, b in zip(outcomes[FASTER].rms_deg, paper, strict=True)]
    assert all(0.5 <= ratio <= 2.0 for ratio in ratios), ratios
    assert len(outcomes[FASTER].run.time_s) == 8000


def test_six_joints_track_like_three(outcomes: Outcomes) -> None:
    six = outcomes[SIX_JOINTS]
    assert len(six.joint_names) == 6
    assert max(six.rms_deg) < 0.004


def test_errors_peak_where_the_velocity_reverses(outcomes: Outcomes) -> None:
    hsia, best = outcomes[FIGURE_5[0]], outcomes[FIGURE_5[-1]]
    times = reversal_times_s(hsia.run)
    assert times == pytest.approx((3.0, 9.0), abs=0.02)
    peaks = reversal_peaks_deg(hsia.run, times)
    assert (peaks.max(axis=0) == np.array(hsia.figures["peak_error_deg"])).all()
    assert (peaks > 10 * reversal_peaks_deg(best.run, times)).all()


def test_a_flight_can_be_repeated_bit_for_bit(outcomes: Outcomes) -> None:
    again = conduct(FIGURE_5[-1])
    before = outcomes[FIGURE_5[-1]]
    assert (again.run.counts == before.run.counts).all()
    assert again.figures == before.figures
    assert again.evidence is Evidence.MEASURED


def test_all_thirteen_rows_rank_like_the_papers(outcomes: Outcomes) -> None:
    rest = conduct_all([e for e in TABLE if e not in outcomes])
    rows = beside_the_paper({**outcomes, **rest})
    assert len(rows) == 13
    assert min(rank_correlation(rows)) > 0.97
    for row in rows:
        assert all(0.5 <= ratio <= 2.0 for ratio in row.ratio), row
