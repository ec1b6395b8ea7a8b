"""The paper's figures from the project's own data, for print and as pages with zoom and hover.

A figure is described once, as panels of lines (:mod:`verification.figures.chart`); Matplotlib draws
it for print and Plotly for the screen.
"""
