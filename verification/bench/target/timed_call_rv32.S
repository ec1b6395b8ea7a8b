/*
 * Measured calls on RV32. The timer is mcycle, which under QEMU's -icount counts virtual
 * nanoseconds. bench_begin and bench_end are where the TCG plugin starts and stops counting:
 * between them are the call, the step and its return. Between the two readings of the timer there
 * is one instruction more, the second reading.
 */
    .equ    PAINT, 0xC5A5C5A5

    .section .text.bench_prepare, "ax"
    .globl  bench_prepare
bench_prepare:
    /* picolibc keeps errno in thread-local storage, which the firmware otherwise has none of. */
    la      tp, thread_storage
    ret

    .section .bss.thread_storage, "aw", @nobits
    .balign 16
thread_storage:
    .skip   64

    .section .text.bench_timed_call, "ax"
    .globl  bench_timed_call
bench_timed_call:
    addi    sp, sp, -16
    sw      ra, 12(sp)
    sw      s0, 8(sp)
    mv      t0, a0
    mv      a0, a1
    mv      a1, a2
    csrr    s0, mcycle
    .globl  bench_begin
bench_begin:
    jalr    t0
    .globl  bench_end
bench_end:
    csrr    a0, mcycle
    sub     a0, a0, s0
    lw      ra, 12(sp)
    lw      s0, 8(sp)
    addi    sp, sp, 16
    ret

    .section .text.bench_painted_call, "ax"
    .globl  bench_painted_call
bench_painted_call:
    addi    sp, sp, -16
    sw      ra, 12(sp)
    sw      s0, 8(sp)
    li      s0, PAINT
    /* The frame's two free words: the lower one ends the search if the step has no stack. */
    sw      zero, 0(sp)
    la      t1, stack_bottom
1:  sw      s0, 0(t1)
    addi    t1, t1, 4
    bltu    t1, sp, 1b
    mv      t0, a0
    mv      a0, a1
    mv      a1, a2
    jalr    t0
    la      t1, stack_bottom
2:  lw      t2, 0(t1)
    addi    t1, t1, 4
    beq     t2, s0, 2b
    addi    t1, t1, -4
    sub     a0, sp, t1
    lw      ra, 12(sp)
    lw      s0, 8(sp)
    addi    sp, sp, 16
    ret
