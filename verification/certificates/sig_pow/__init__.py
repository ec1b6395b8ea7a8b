"""The error of sig_pow, proved for every exponent and every normal float.

- :mod:`kernel`: the C as it was generated, and its stages as data.
- :mod:`prove`: the bounds by ball arithmetic, as statements and as a certificate.
- :mod:`check`: verifies a certificate against the C with other arithmetic and other formulas.
- :mod:`exhaustive`: both integer halves of the compiled C at every mantissa.
"""
