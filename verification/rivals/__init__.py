"""What a user would pick instead, on the same plants with the same effort of tuning."""
