"""Table II of the paper flown again, beside the paper."""
