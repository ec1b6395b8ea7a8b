"""Tests of the firmware, on this computer and on emulated boards."""
