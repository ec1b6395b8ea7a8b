"""The structures of the generated C as data: one table for the header and for every binding.

The C header, the default configuration, the run-time check and the ctypes binding are all made
from :func:`layout`; no structure is typed twice.
"""

from __future__ import annotations

from codegen.controller import Controller, Joint
from codegen.fixed_point import fixed_config_values, fixed_layout
from codegen.floating_point import FieldValue, floating_config_values, floating_layout
from codegen.structs import Layout


def layout(controller: Controller) -> Layout:
    """The structures of a controller."""
    fixed = controller.arithmetic.kind == "fixed-point"
    return fixed_layout(controller) if fixed else floating_layout(controller)


def joint_config_values(controller: Controller, joint: Joint) -> dict[str, FieldValue]:
    """The configuration of a joint in the C of a controller, by field name.

    Args:
        controller: whose C it is for; integers are in its units.
        joint: one of its own for the default configuration, or one with other gains.
    """
    fixed = controller.arithmetic.kind == "fixed-point"
    values = fixed_config_values if fixed else floating_config_values
    return values(controller, joint)
