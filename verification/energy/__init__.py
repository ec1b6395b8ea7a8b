"""Energy along the closed loop: what the shipped C's own errors and sliding variable do in time."""
