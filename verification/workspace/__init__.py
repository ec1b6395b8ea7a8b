"""Condition (33) over a robot's whole workspace: all eigenvalues of M(q)^-1 Mbar, certified."""
