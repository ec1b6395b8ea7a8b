"""A rival as C behind the shipped controller's header, so that it flies in the same compiled loop.

CasADi prints the law, ``rival.c.j2`` is everything around it. Gains and memory follow the header's
own structures, in the C and in Python alike, so that runs share nothing but code.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np

from codegen.controller import Controller
from codegen.emit import GeneratedFiles, generate, write
from codegen.rendering import environment
from plant.compiled.loop import CompiledLoop
from plant.compiled.rigid_body import SX
from plant.controller import GeneratedController
from plant.native import BUILD
from verification.rivals.laws import Law, Signals
from verification.rivals.model import Floats
from verification.special_cases.source import check, default_config_c

FOLDER = Path(__file__).parent
OUTPUT = BUILD / "rivals"


def law_function(law: Law, joints: int) -> ca.Function:
    """(gains, q, qd, e, ed, qd_d, qdd_d, integral) to (torque, rate); gains have a column each."""
    gains = ca.SX.sym("gains", joints, len(law.knobs))
    now = Signals(*(ca.SX.sym(name, joints) for name in Signals.__annotations__))
    named = {knob.name: gains[:, k] for k, knob in enumerate(law.knobs)}
    answer = law.answer(now, named)
    return ca.Function("rival_law", [gains, *vars(now).values()], ca.cse([*answer]))


def standing_function(law: Law, joints: int) -> ca.Function:
    """q to the torque of the law at rest there, without error."""
    q: SX = ca.SX.sym("q", joints)
    return ca.Function("rival_standing", [q], [law.standing(q)])


def controller_c(law: Law, controller: Controller) -> dict[str, str]:
    """The C of a rival by file name: the law, and all around it.

    Raises:
        PlantError: the specification is of another structure or in fixed-point.
    """
    check(controller)
    generator = ca.CodeGenerator("law.c")
    for function in (law_function, standing_function):
        generator.add(function(law, len(controller.joints)))
    around = (
        environment(FOLDER)
        .get_template("rival.c.j2")
        .render(
            name=controller.name,
            source=law.source,
            gains=len(law.knobs),
            default_config=default_config_c(controller),
        )
    )
    return {"law.c": generator.dump(), f"tdc_{controller.name}.c": around}


def write_sources(law: Law, controller: Controller, folder: str) -> Path:
    """The C of a rival with its headers, in a folder of ``build/rivals/``.

    Raises:
        GenerationError: it can't be written.
    """
    headers = {n: text for n, text in generate(controller).files.items() if n.endswith(".h")}
    return write(GeneratedFiles(folder, {**headers, **controller_c(law, controller)}), OUTPUT)


def write_shipped(controller: Controller, folder: str) -> Path:
    """The shipped C likewise; errors as of :func:`write_sources`."""
    return write(GeneratedFiles(folder, generate(controller).files), OUTPUT)


class Rival(GeneratedController):
    """A rival's compiled C; fulfils :class:`plant.closed_loop.Controller`.

    Args:
        law: what it is.
        loop: the library that it is in.
    """

    def __init__(self, law: Law, loop: CompiledLoop) -> None:
        super().__init__(loop.specification, loop.path)
        self._law, shared = law, self.config
        self.config, self.state = (
            _config(type(shared), len(law.knobs), self.joints)(),
            _state(self.types.state, self.joints)(),
        )
        ctypes.memmove(ctypes.byref(self.config), ctypes.byref(shared), ctypes.sizeof(shared))
        self._pointers = (*map(ctypes.byref, (self.config, self.state)), *self._pointers[2:])

    def tune(self, gains: Mapping[str, Floats]) -> None:
        """Sets all gains, each of shape (n,)."""
        for row, knob in zip(self.config.gain, self._law.knobs, strict=True):
            row[:] = np.asarray(gains[knob.name]).tolist()


# ctypes lays a subclass's fields out behind the base's, as C does a structure that begins with it.


@cache
def _config(shared: type[ctypes.Structure], gains: int, joints: int) -> type[ctypes.Structure]:
    return type(
        "rival_config", (shared,), {"_fields_": [("gain", ctypes.c_double * joints * gains)]}
    )


@cache
def _state(shared: type[ctypes.Structure], joints: int) -> type[ctypes.Structure]:
    fields = [
        ("counts", ctypes.c_int32 * joints),
        ("start_torque_Nm", ctypes.c_double * joints),
        ("integral", ctypes.c_double * joints),
    ]
    return type("rival_state", (shared,), {"_fields_": fields})
