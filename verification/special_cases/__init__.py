"""The inclusive claim, exact: every special case as a law of its own, bit for bit in the loop."""
