/* Start-up of a 32-bit RISC-V hart with single precision: stack, FPU, traps. */

    .section .vectors, "ax"
    .globl reset_handler
reset_handler:
    la      sp, stack_top
    la      t0, trap_handler
    csrw    mtvec, t0
    /* mstatus.FS = initial: without it every floating-point instruction traps. */
    li      t0, 0x2000
    csrs    mstatus, t0
    /* Round to nearest, no flags; RISC-V has no flush-to-zero. */
    csrw    fcsr, zero
    call    core_run
1:  j       1b
