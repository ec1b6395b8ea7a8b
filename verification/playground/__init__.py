"""The generated C in a web page: the same functions as WebAssembly, with sliders for the gains.

- :mod:`wasm`: C to WebAssembly, with the compiler that the package ziglang brings.
- :mod:`memory`: where the C's structures have their fields, for the page's JavaScript.
- :mod:`flight`: all that a flight of the reference plant begins with.
- :mod:`vectors`: ticks of all controllers with the torques of the host, which the page repeats.
- :mod:`page`: the one file that comes of it, and needs no network.
"""
