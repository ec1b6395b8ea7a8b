# Facts that hold for every board, read by the build and by Python alike: NAME := value, no $().

# How the generated C is compiled for shipping; without -ffp-contract=off the bits differ.
C_FLAGS := -std=c99 -O2 -ffp-contract=off
# Freestanding takes the compiler's own headers and no libc; -fbuiltin keeps memcpy of a word a move.
FREESTANDING_FLAGS := -ffreestanding -fbuiltin -ffunction-sections -fdata-sections
WARNING_FLAGS := -pedantic -Wall -Wextra -Wconversion -Wfloat-conversion -Wdouble-promotion -Wshadow -Wstrict-prototypes -Wcast-qual -Wundef -Wvla -Werror
LINK_FLAGS := -nostdlib -static -Wl,--gc-sections -Wl,--fatal-warnings
# Frame sizes (.su) and the call graph (.ci), from which `make size` takes the deepest path.
STACK_FLAGS := -fstack-usage -fcallgraph-info=su
STACK_BYTES := 4096

# No window, no monitor; the console's bytes come and go on standard input and output.
QEMU_OPTIONS := -nodefaults -display none -monitor none
QEMU_SEMIHOSTING := -semihosting-config enable=on,target=native
# One instruction takes 2^5 ns of the emulated clock, whatever the host does meanwhile.
QEMU_STEADY_CLOCK := -icount shift=5
