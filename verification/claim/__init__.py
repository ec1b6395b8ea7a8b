"""The claim that the inclusive law is the best of Table II, on random plants: how far it holds."""
