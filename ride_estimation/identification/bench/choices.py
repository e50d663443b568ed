# Copyright 2026 ride_estimation contributors
"""The names one chooses by: models, misfits, ways of reading loops, tests. Nothing is imported here."""

from __future__ import annotations

#: rungs of the ladder in order of complexity
MODELS = (
    "linear_spring", "kelvin_voigt", "cubic", "maxwell", "friction", "dahl", "berg_viscous", "berg", "maxwell_dahl", "cubic_dahl",
    "cubic_berg", "modified_berg", "three_cell_berg",
)  # fmt: skip
#: models of a stop that is loaded on one side
JOUNCE_MODELS = ("jounce_bumper", "local_linear_network", "local_linear_network_dahl")
#: misfits of a fit to operating points
NORMS = ("complex_modulus", "repaired", "printed")
#: how dynamic stiffness and loss are taken from harmonic tests
EXTRACTIONS = ("harmonic", "peak", "range")
#: tests beside preconditioning
TESTS = ("static", "sigmoid_chirp", "dma", "random", "random_wide", "pulse")
#: longest programme where none is asked for [s]
LONGEST_S = 1800.0
