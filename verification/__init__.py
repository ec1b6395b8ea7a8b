"""Proofs, experiments and equivalence checks of the generated C, and the report on them."""
