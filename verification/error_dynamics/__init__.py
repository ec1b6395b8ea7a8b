"""The desired error dynamics of one joint: how the error ends, when, and what is proved of it.

- :mod:`model`: gains and exponents, exact, and the words for what they do.
- :mod:`classes`: how the error ends, for any exponents.
- :mod:`phase_plane`: node or focus, and the quadratures of a homogeneous pair.
- :mod:`motion`: times of whole motions.
- :mod:`analysis`: all of it for one joint, as one record.
- :mod:`command`: ``python -m verification error-dynamics``.
"""
