# Facts of a family of cores, read by the build and by Python alike: NAME := value, no $().
TOOLCHAIN := riscv64-unknown-elf-
TOOLCHAIN_PACKAGE := gcc-riscv64-unknown-elf
# The C functions that the stack of the program and of its tick begin with.
STARTUP := core_run
TICK_HANDLER := trap_handler
