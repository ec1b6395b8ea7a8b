"""Fuzzing of the generated C: libFuzzer with sanitizers, and the header's contract as oracle.

``target/fuzz.c`` is the same for every controller. What it has to know of a controller's structures
is written for it from the generator's own description (:mod:`verification.fuzz.tables`), so that
a new field is fuzzed from the day on which it exists.
"""
