"""Validated arithmetic: proofs that leave a certificate, and checkers with code of their own."""
