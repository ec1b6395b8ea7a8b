"""Packages of a generated controller: CMake, an FMU, and manifests for embedded build systems.

- :mod:`contents`: what a package is, and all that its templates say.
- :mod:`variables`: the variables of the FMU, one table for its XML and its C.
- :mod:`fmu`: the FMU itself.
- :mod:`figures`: what the controller costs and how it settles, measured and enclosed.
- :mod:`recording`: a flight of the controller, against which the FMU is held.
- :mod:`checks`: each part tried with the strongest tool that works without a network; the FMU in
  :mod:`simulation`, the manifests in :mod:`manifests`, the tools in :mod:`tools`.
- :mod:`making`: all of it, written whole or not at all.
"""
