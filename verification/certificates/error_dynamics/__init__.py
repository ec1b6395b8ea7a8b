"""Strict Lyapunov functions of the desired error dynamics, with certificates.

- :mod:`prove`: finds one and proves it, by ball arithmetic or exactly, as a certificate.
- :mod:`check`: verifies a certificate with the standard library alone, in decimal intervals, from
  formulas of its own.

Both are of one joint: the gains are diagonal, so that joints are decoupled.
"""
