"""A simulated robot, its friction, drive and encoder, and the closed loop with generated C."""
