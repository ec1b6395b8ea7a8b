# Facts of a board, read by the build and by Python alike: NAME := value, no $().
CORE_NAME := Cortex-M4F
CORE := cortex-m
CPU_FLAGS := -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16
# What the core pushes on the stack at an interrupt: 26 words with the FPU, 1 to align to 8 bytes.
INTERRUPT_FRAME_BYTES := 108
TICK_CLOCK_HZ := 25000000
# Which file of hal/ implements hal.h.
HAL := emulated
UART := cmsdk_uart
UART_ADDRESS := 0x40004000
QEMU := qemu-system-arm -machine mps2-an386
QEMU_PACKAGE := qemu-system-arm
