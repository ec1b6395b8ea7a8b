# Facts of a family of cores, read by the build and by Python alike: NAME := value, no $().
TOOLCHAIN := arm-none-eabi-
TOOLCHAIN_PACKAGE := gcc-arm-none-eabi
# The C functions that the stack of the program and of its tick begin with.
STARTUP := reset_handler
TICK_HANDLER := systick_handler
