"""`python -m verification claim`: how far Table II holds on random plants."""

from __future__ import annotations

import argparse

from plant.campaign.runs import CampaignError
from verification.claim import present
from verification.claim.flown import ClaimError
from verification.commands.output import Output
from verification.evidence import plain

ERRORS = (CampaignError, ClaimError)
add_arguments = present.add_arguments


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    with output.status("campaigns"):
        claim, pictures = present.examine(
            present.SPECIFICATIONS, arguments.results, present.PICTURES
        )
    if not output.as_json:
        present.show(claim, pictures, output.console)
    output.leave(plain(claim), "claim")
    return 0
