"""The variants of the control step: what is written, generated and compiled for each.

All of them compute the law for all joints of one controller from the same input. The naive ones
are one CasADi function of :mod:`codegen.law`'s expressions, printed by CasADi's own generator,
and a wrapper that does what the function can't, which is to difference wrapping counters.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as ca

from codegen import law
from codegen.arithmetic import Arithmetic
from codegen.controller import Controller, Joint
from codegen.exact import binary32
from codegen.floating_point import scale_values
from codegen.literals import float_literal
from codegen.rendering import environment
from verification.firmware import Board

PACKAGE = Path(__file__).parent
TARGET = PACKAGE / "target"
TEMPLATES = PACKAGE / "templates"

LINEAR_EXPERIMENT = "Exp02"
"""The row of Table II with all exponents 1: Jin's linear law."""


@dataclass(frozen=True)
class Variant:
    """A way to have the control step.

    Attributes:
        name: for scripts.
        title: for tables and pictures.
        meaning: one sentence.
        experiment: the row of Table II whose gains it has, None for the controller's own.
        write: from the controller, the directory of its generated C and a directory to write
            what else is needed into, the C files to compile.
        numbers: the keys of the specification that it changes, and their values.
        fpu_bits: of the widest number that the core's FPU must compute with; 0 for none.
        flags: more compiler flags.
    """

    name: str
    title: str
    meaning: str
    experiment: str | None
    write: Callable[[Controller, Path, Path], tuple[Path, ...]]
    numbers: tuple[tuple[str, str], ...] = ()
    fpu_bits: int = 0
    flags: tuple[str, ...] = ()

    def fits(self, board: Board) -> bool:
        """Whether the board's core is one that the variant is for."""
        return self.fpu_bits <= fpu_bits(board)


def fpu_bits(board: Board) -> int:
    """Bits of the widest number that the core computes with by itself: 0, 32 or 64."""
    flags = " ".join(board.cpu_flags)
    if "-mfloat-abi=soft" in flags or "-mabi=ilp32 " in f"{flags} ":
        return 0
    return 64 if re.search(r"-mfpu=fpv5-d16|-mabi=ilp32d", flags) else 32


def _render(template: str, target: Path, **values: Any) -> Path:
    target.write_text(
        environment(TEMPLATES).get_template(template).render(values), encoding="utf-8"
    )
    return target


# --- Naive CasADi ------------------------------------------------------------------------------


def law_function(controller: Controller) -> Any:
    """The whole law for all joints as one ``casadi.Function``.

    Its inputs are a vector over the joints for each gain, scale and signal, the sample time, and
    whether the controller is running; its outputs the limited torques and the next integrals.
    """
    joints = len(controller.joints)
    parts = (law.measurement(controller.options), law.torque_law(controller.options))
    computed = {q.name for part in parts for q in part.quantities}
    declared = {i.name: i for part in parts for i in part.inputs if i.name not in computed}
    symbols = {
        name: ca.SX.sym(name, 1 if i.home is law.Home.CONSTANT else joints)
        for name, i in declared.items()
    }
    running = ca.SX.sym("running")

    def joint(j: int) -> tuple[Any, Any]:
        known = {name: s if s.numel() == 1 else s[j] for name, s in symbols.items()}
        known |= _call(parts[0], known)
        start = _call(law.switch_on(), known)["sliding_integral"]
        known["sliding_integral"] = ca.if_else(running, known["sliding_integral"], start)
        known |= _call(parts[1], known)
        return known["limited_torque"], known["next_sliding_integral"]

    torques, integrals = zip(*(joint(j) for j in range(joints)), strict=True)
    return ca.Function(
        "naive_law",
        [*symbols.values(), running],
        [ca.vertcat(*torques), ca.vertcat(*integrals)],
        [*symbols, "running"],
        ["limited_torque", "next_sliding_integral"],
    )


def _call(part: law.LawFunction, known: dict[str, Any]) -> dict[str, Any]:
    outputs = part.casadi_function().call([known[i.name] for i in part.inputs])
    return dict(zip((q.name for q in part.quantities), outputs, strict=True))


def write_naive(controller: Controller, directory: Path, real: str) -> tuple[Path, ...]:
    """CasADi's own C for the law and the wrapper that feeds it."""
    function = law_function(controller)
    options: dict[str, Any] = {
        "casadi_real": real,
        "casadi_int": "int",
        "with_export": False,
        "with_header": True,
        "static_aux": True,
    }
    generator = ca.CodeGenerator("naive_law.c", options)
    generator.add(function)
    generator.generate(f"{directory}/")
    number = float_literal if real == "float" else repr
    convert = binary32 if real == "float" else float
    exact = replace(controller, arithmetic=Arithmetic(precision="float64"))
    parameters = {
        name: [number(convert(value)) for value in values]
        for name, values in _parameters(exact if real == "double" else controller).items()
    }
    names = function.name_in()
    signals = [n for n in names if n in law.SIGNALS]
    wrapper = _render(
        "naive.c.j2",
        directory / "naive.c",
        parameters={n: parameters[n] for n in names if n in parameters},
        sample_time_name=law.SAMPLE_TIME.name,
        sample_time=number(convert(controller.sample_time)),
        signals=signals,
        arguments=names,
    )
    return (wrapper, directory / "naive_law.c")


def _parameters(controller: Controller) -> dict[str, list[Any]]:
    """Gains and scales by the law's names, one value a joint."""
    gains = {
        name: [getattr(j, "lambda_" if name == "lambda" else name) for j in controller.joints]
        for name in law.GAINS
        if name != "low_pass_ratio"
    }
    scales = {
        name: [scale_values(controller, j)[name] for j in controller.joints] for name in law.SCALES
    }
    return gains | scales


# --- The floor ---------------------------------------------------------------------------------


def write_linear(controller: Controller, _: Path, directory: Path) -> tuple[Path, ...]:
    """The hand-written linear step with this controller's numbers."""

    def numbers(joint: Joint) -> dict[str, float]:
        scales = scale_values(controller, joint)
        return {
            "inertia": binary32(joint.inertia),
            "kd": binary32(joint.kd),
            "kp": binary32(float(joint.kp) * scales["position"]),
            "lambda": binary32(joint.lambda_),
            "velocity": scales["velocity"],
            "acceleration": scales["acceleration"],
            "torque_limit": binary32(joint.torque_limit),
        }

    constants = _render(
        "linear_joints.c.j2",
        directory / "linear_joints.c",
        c=controller,
        joints=[numbers(joint) for joint in controller.joints],
        sample_time=binary32(controller.sample_time),
        literal=float_literal,
    )
    return (TARGET / "linear.c", constants)


# --- All of them -------------------------------------------------------------------------------


def write_project(_: Controller, generated: Path, __: Path) -> tuple[Path, ...]:
    """This project's C as it is; nothing to write."""
    return (TARGET / "project.c", *sorted(generated.glob("*.c")))


NAIVE_DOUBLE = Variant(
    "naive-double",
    "naive CasADi, double",
    "One CasADi function, printed by CasADi's own generator, as it comes.",
    None,
    lambda controller, _, directory: write_naive(controller, directory, "double"),
)
NAIVE_FLOAT = Variant(
    "naive-float",
    "naive CasADi, float",
    "The same printed with casadi_real=float: variables are float, pow and fabs stay double.",
    None,
    lambda controller, _, directory: write_naive(controller, directory, "float"),
)
CASADI_POWF = Variant(
    "casadi-powf",
    "CasADi with powf",
    "The same with macros that turn pow, fabs, fmin and fmax into powf, fabsf, fminf and fmaxf.",
    None,
    lambda controller, _, directory: write_naive(controller, directory, "float"),
    flags=("-include", str(TARGET / "powf.h")),
)
PROJECT = Variant(
    "project",
    "this project",
    "The generated step with all its checks and the exponents of the specification.",
    None,
    write_project,
)
PROJECT_PRECISE = Variant(
    "project-precise",
    "this project, precise",
    'The generated step with accuracy = "precise": powers in float to 1.93 ulp.',
    None,
    write_project,
    (("accuracy", "precise"),),
    fpu_bits=32,
)
PROJECT_FLOAT64 = Variant(
    "project-float64",
    "this project, float64",
    'The generated step with precision = "float64", for cores with an FPU for double.',
    None,
    write_project,
    (("precision", "float64"),),
    fpu_bits=64,
)
PROJECT_FIXED = Variant(
    "project-fixed",
    "this project, fixed-point",
    'The generated step with arithmetic = "fixed-point": integers inside and at the interface.',
    None,
    write_project,
    (("arithmetic", "fixed-point"),),
)
PROJECT_LINEAR = Variant(
    "project-linear",
    "this project, linear",
    "The generated step with all its checks, all exponents 1 (Exp02).",
    LINEAR_EXPERIMENT,
    write_project,
)
LINEAR_FLOOR = Variant(
    "linear-floor",
    "linear law by hand",
    "The floor: a linear step written by hand, without powers and without checks.",
    LINEAR_EXPERIMENT,
    write_linear,
)

VARIANTS = (
    NAIVE_DOUBLE,
    NAIVE_FLOAT,
    CASADI_POWF,
    PROJECT,
    PROJECT_PRECISE,
    PROJECT_FLOAT64,
    PROJECT_FIXED,
    PROJECT_LINEAR,
    LINEAR_FLOOR,
)
WITH_POWERS = (PROJECT, PROJECT_PRECISE, PROJECT_FLOAT64, PROJECT_FIXED)
"""What a specification chooses from: this project's step in all its numbers."""


def variant_of(controller: Controller) -> Variant:
    """This project's step in a controller's numbers."""
    return next(v for v in WITH_POWERS if _arithmetic(v) == controller.arithmetic)


def _arithmetic(variant: Variant) -> Arithmetic:
    chosen: dict[str, Any] = dict(variant.numbers)
    kind = chosen.pop("arithmetic", Arithmetic().kind)
    return Arithmetic(kind=kind, **chosen)
