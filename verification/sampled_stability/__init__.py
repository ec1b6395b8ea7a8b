"""For which Mbar/M the sampled law is stable: the interval that condition (33) does not see."""
