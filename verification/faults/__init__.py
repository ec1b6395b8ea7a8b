"""What faults do to the closed loop in motion, and what each guard of the generated C is worth."""
