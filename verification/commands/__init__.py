"""The commands of `python -m verification`, one module each."""
