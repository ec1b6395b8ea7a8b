/*
 * Measured calls on Cortex-M, with ARMv6-M's instructions only. The timer is SysTick on the
 * processor clock, which counts down in 24 bits. bench_begin and bench_end are where the TCG plugin
 * starts and stops counting: between them are the call, the step and its return. Between the two
 * readings of the timer there is one instruction more, the second reading.
 */
    .syntax unified
    .thumb

    .equ    SYST_CSR, 0xE000E010
    .equ    SYST_CVR, 0xE000E018
    .equ    PAINT, 0xC5A5C5A5

    .section .text.bench_prepare, "ax"
    .globl  bench_prepare
    .thumb_func
bench_prepare:
    ldr     r0, =SYST_CSR
    ldr     r1, =0x00FFFFFF
    str     r1, [r0, #4]            /* reload value */
    movs    r1, #0
    str     r1, [r0, #8]            /* writing the counter clears it: it starts from the reload */
    movs    r1, #5
    str     r1, [r0]                /* on, processor clock, no interrupt */
    bx      lr
    .pool

    .section .text.bench_timed_call, "ax"
    .globl  bench_timed_call
    .thumb_func
bench_timed_call:
    push    {r4-r6, lr}
    mov     r3, r0
    mov     r0, r1
    mov     r1, r2
    ldr     r4, =SYST_CVR
    ldr     r5, [r4]
    .globl  bench_begin
bench_begin:
    blx     r3
    .globl  bench_end
bench_end:
    ldr     r6, [r4]
    subs    r0, r5, r6
    lsls    r0, r0, #8              /* the lower 24 bits */
    lsrs    r0, r0, #8
    pop     {r4-r6, pc}
    .pool

    .section .text.bench_painted_call, "ax"
    .globl  bench_painted_call
    .thumb_func
bench_painted_call:
    push    {r4, lr}
    mov     r3, r0
    mov     r0, r1
    mov     r1, r2
    mov     ip, sp
    ldr     r2, =stack_bottom
    ldr     r4, =PAINT
1:  stmia   r2!, {r4}
    cmp     r2, ip
    blo     1b
    blx     r3
    ldr     r2, =stack_bottom
2:  ldmia   r2!, {r3}
    cmp     r3, r4
    beq     2b
    subs    r2, #4
    mov     r0, sp
    subs    r0, r0, r2
    pop     {r4, pc}
    .pool
