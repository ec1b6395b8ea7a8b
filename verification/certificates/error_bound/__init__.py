"""Bounds of s and e of one joint under a bounded TDE error, with certificates.

- :mod:`barrier`: finds a curve that no disturbed motion leaves, in floating point.
- :mod:`prove`: makes a certificate of it, and of the bound of s.
- :mod:`check`: verifies a certificate with the standard library alone.
"""
