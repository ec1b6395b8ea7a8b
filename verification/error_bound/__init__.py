"""How large s and e can be while the TDE error is bounded, one joint at a time.

- :mod:`analysis`: bounds for given gains, proved by certificates.
- :mod:`command`: ``python -m verification error-bound``.
"""

from verification.error_bound.analysis import ErrorBound, error_bound

__all__ = ["ErrorBound", "error_bound"]
