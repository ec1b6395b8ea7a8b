"""Is a gain set safe, and how good is it: all that the project knows of it, on one page.

- :mod:`joint`: what a specification alone says of a joint: error dynamics, intervals, noise.
- :mod:`robot`: the eigenvalues of M(q)^-1 Mbar of a plant.
- :mod:`flight`: a run on the plant: TDE error, vibration, saturation.
- :mod:`verdict`: which of it is unsafe, by named thresholds.
- :mod:`check`: all of it for one controller, as one record.
- :mod:`remedy`: by what Mbar or the correction must change, flown.
- :mod:`present`, :mod:`page`, :mod:`pictures`: for people.
"""
