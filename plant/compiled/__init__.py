"""The compiled backend: plant and generated controller in one shared library, a run in one call."""
