"""Campaigns: thousands of runs of generated C on random plants, one row of figures a run."""
