# Facts of a board, read by the build and by Python alike: NAME := value, no $().
CORE_NAME := RV32IMAFC
CORE := rv32
CPU_FLAGS := -march=rv32imafc -mabi=ilp32f
# The core pushes nothing at an interrupt: the handler's own frame holds what it saves.
INTERRUPT_FRAME_BYTES := 0
TICK_CLOCK_HZ := 10000000
# Which file of hal/ implements hal.h.
HAL := emulated
UART := ns16550
UART_ADDRESS := 0x10000000
QEMU := qemu-system-riscv32 -machine virt -bios none -cpu rv32,d=false
QEMU_PACKAGE := qemu-system-misc
