"""A gain set's page: one HTML file that needs nothing else."""

from __future__ import annotations

from pathlib import Path

from verification.evidence import Evidence
from verification.style import pages
from verification.tuning_check import pictures, present
from verification.tuning_check.check import TuningCheck
from verification.tuning_check.verdict import Severity

_TEMPLATES = Path(__file__).parent / "templates"
_CLASSES = {Severity.SAFE: "good", Severity.RESERVATION: "reserved", Severity.UNSAFE: "bad"}


def render(checked: TuningCheck) -> str:
    """The page; the same check gives the same bytes."""
    names = [joint.name for joint in checked.joints]
    return (
        pages(_TEMPLATES)
        .get_template("tuning_check.html.j2")
        .render(
            checked=checked,
            names=names,
            headline=present.headline(checked),
            classes=_CLASSES,
            findings=[
                (finding, "" if len(of) == len(names) else ", ".join(of))
                for finding, of in present.grouped(checked)
            ],
            remedy=checked.remedy.says if checked.remedy else None,
            rows=list(present.rows(checked)),
            notes=list(present.notes(checked)),
            intervals=pictures.intervals(checked),
            portraits=pictures.portraits(checked),
            errors=pictures.errors(checked),
            kinds={kind.value: kind for kind in Evidence},
            told=[Evidence.PROVED, Evidence.MEASURED, Evidence.SAMPLED],
        )
    )


def write(checked: TuningCheck, path: Path) -> Path:
    """Writes the page, and the folder that it is in."""
    # The page is rendered before anything is written.
    text = render(checked)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path
