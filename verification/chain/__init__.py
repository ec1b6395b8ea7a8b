"""From the exact law to the bits on each target, link by link, on the same recorded steps."""
