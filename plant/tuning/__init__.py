"""Tuning: the paper's procedure III-E carried out on a plant, and an optimiser beside it."""
