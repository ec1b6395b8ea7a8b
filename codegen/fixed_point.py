"""placeholder"""
from codegen.controller import Controller, Joint
from codegen.structs import Layout
def fixed_layout(controller: Controller) -> Layout: raise NotImplementedError
def fixed_config_values(controller: Controller, joint: Joint): raise NotImplementedError
