"""C of a special case: a whole controller with the header of the inclusive one.

The law comes through the printer of the shipped C. All around it, from the counts to the limits
of the torque, is written here once more (``special.c.j2``), so that nothing but the header, the
numbers of the specification and the power function is the inclusive controller's.
"""

from __future__ import annotations

from pathlib import Path

from codegen.c99 import Statement, print_law
from codegen.controller import Controller
from codegen.emit import GeneratedFiles, generate, identity, write
from codegen.floating_c import floating_source
from codegen.floating_point import scale_values
from codegen.law import GAINS, Home, Input, LawFunction, LawOptions
from codegen.layout import layout
from codegen.rendering import environment
from plant.assembly import PlantError
from plant.native import BUILD
from verification.special_cases.laws import INVERSE_SIGMA, LARGEST, SIGMA, errors

FOLDER = Path(__file__).parent
OUTPUT = BUILD / "special_cases"


def check(controller: Controller) -> None:
    """The cases are written for the paper's law as it stands, in floating-point.

    Raises:
        PlantError: the specification is of another structure or in fixed-point.
    """
    if controller.arithmetic.kind != "floating-point" or controller.options != LawOptions():
        raise PlantError(
            f"controller {controller.name} isn't the paper's law in floating-point: the special "
            "cases need reference-rate, current acceleration, no low-pass, no torque report; name "
            "another one with --controller, such as puma3"
        )


def controller_c(law: LawFunction, controller: Controller) -> str:
    """``tdc_NAME.c`` of a special case, with the controller's gains as its default.

    Args:
        law: of ``laws``.
        controller: the specification, in floating-point and with the structure of the paper.

    Raises:
        PlantError: the specification is of another structure or in fixed-point.
    """
    check(controller)
    structures, real = layout(controller), controller.arithmetic.real
    fields = {f.quantity: f.name for f in structures.joint_config.fields if f.quantity}
    spelled = {
        **{name: f"gains->{fields[name]}" for name in GAINS if name in fields},
        "sliding_integral": "last->sliding_integral_rad_per_s",
        "last_torque": "last->applied_torque_Nm",
        "reference_acceleration": "input->reference_acceleration_rad_per_s2[i]",
        "sample_time": f"TDC_{controller.name.upper()}_SAMPLE_TIME_S",
        LARGEST.name: real.largest,
        INVERSE_SIGMA.name: f"gains->{fields['inertia']}",
        SIGMA.name: f"({real.literal(1.0)} / gains->{fields['inertia']})",
        **{quantity.name: f"now.{quantity.name}" for quantity in errors().quantities},
    }

    def spelling(parameter: Input) -> str:
        if parameter.home is Home.SCALE:
            return f"scale->{parameter.name}"
        return spelled.get(parameter.name, parameter.name)

    def printed(function: LawFunction) -> tuple[Statement, ...]:
        return print_law(function, spelling, real)

    shipped = floating_source(controller, structures)
    return (
        environment(FOLDER)
        .get_template("special.c.j2")
        .render(
            name=controller.name,
            law=law,
            real=real,
            headers=[file for file in shipped.files if file.endswith(".h")],
            default_config=default_config_c(controller),
            scales=[
                {k: real.literal(v) for k, v in scale_values(controller, joint).items()}
                for joint in controller.joints
            ],
            errors=printed(errors()),
            statements=printed(law),
            integral=any(q.name == "next_sliding_integral" for q in law.quantities),
        )
    )


def default_config_c(controller: Controller) -> str:
    """The C of the default configuration that the header declares."""
    structures = layout(controller)
    context = floating_source(controller, structures).context
    text: str = (
        environment()
        .get_template("default_config.j2")
        .render(
            c=controller,
            p=f"tdc_{controller.name}",
            J=f"TDC_{controller.name.upper()}_JOINTS",
            identity=f"0x{identity(controller):08X}u",
            layout=structures,
            **{k: context[k] for k in ("initialiser", "counts_type", "counts_per_rad")},
        )
    )
    return text


def write_sources(law: LawFunction, controller: Controller, folder: str) -> Path:
    """The C of a special case with its headers, in a folder of ``build/special_cases/``.

    Raises:
        GenerationError: it can't be written.
    """
    own = f"tdc_{controller.name}.c"
    shared = {n: text for n, text in generate(controller).files.items() if n.endswith((".c", ".h"))}
    files = {**shared, own: controller_c(law, controller)}
    return write(GeneratedFiles(folder, files), OUTPUT / controller.name)
