"""What a control step costs: instructions, flash and stack, counted on emulated processors.

:func:`verification.bench.rows.measure_all` gives the rows, :mod:`verification.bench.present` the
table and the picture; ``python -m verification.bench`` does both. :mod:`verification.bench.cycles`
estimates cycles from what was executed.
"""
