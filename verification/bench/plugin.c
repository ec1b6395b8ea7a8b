/*
 * A QEMU TCG plugin that counts the instructions a guest executes between two addresses.
 *
 * Arguments: begin=ADDRESS, end=ADDRESS (of instructions, any base) and out=FILE, into which one
 * decimal number a line is written for each time that execution passed from begin to end: the
 * instructions from begin on, begin included, end excluded.
 *
 * With runs=FILE, first=N and last=N the passes from the first to the last, counted from 0, are
 * recorded as well, all together: a line "FROM TO NEXT COUNT" says how often execution went through
 * all instructions from one address to another and then on to a third (addresses in hexadecimal).
 *
 * QEMU's API is declared here by hand, because Debian ships QEMU without qemu-plugin.h. Names and
 * types follow QEMU's documentation (docs/devel/tcg-plugins), version 1 of the API.
 */
#include <inttypes.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef uint64_t qemu_plugin_id_t;
typedef struct qemu_info_t qemu_info_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
typedef void (*tb_trans_callback)(qemu_plugin_id_t id, struct qemu_plugin_tb *tb);
typedef void (*vcpu_callback)(unsigned int vcpu_index, void *userdata);
typedef void (*exit_callback)(qemu_plugin_id_t id, void *userdata);

enum { CB_NO_REGS = 0, INLINE_ADD_U64 = 0 };

extern void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id, tb_trans_callback cb);
extern size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *tb);
extern struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *tb,
                                                        size_t index);
extern uint64_t qemu_plugin_insn_vaddr(const struct qemu_plugin_insn *insn);
extern void qemu_plugin_register_vcpu_insn_exec_cb(struct qemu_plugin_insn *insn, vcpu_callback cb,
                                                   int flags, void *userdata);
extern void qemu_plugin_register_vcpu_insn_exec_inline(struct qemu_plugin_insn *insn, int op,
                                                       void *pointer, uint64_t immediate);
extern void qemu_plugin_register_vcpu_tb_exec_cb(struct qemu_plugin_tb *tb, vcpu_callback cb,
                                                 int flags, void *userdata);
extern void qemu_plugin_register_atexit_cb(qemu_plugin_id_t id, exit_callback cb, void *userdata);

#define EXPORT __attribute__((visibility("default")))

EXPORT extern const int qemu_plugin_version;
const int qemu_plugin_version = 1;

static uint64_t begin_address;
static uint64_t end_address;
static FILE *output;
static uint64_t executed; /* instructions since the start of the machine */
static uint64_t at_begin; /* what `executed` was at begin */

/* Where execution went on behind a block, and how often. */
typedef struct successor {
    uint64_t address;
    uint64_t count;
    struct successor *next;
} successor;

/* Instructions that QEMU translated together: only the last of them may jump. */
typedef struct block {
    uint64_t first;
    uint64_t last;
    successor *successors;
    struct block *next;
} block;

static FILE *runs;          /* NULL: nothing is recorded */
static uint64_t first_pass; /* to record */
static uint64_t last_pass;
static uint64_t pass;
static block *blocks;
static block begin_block; /* of the call of the step alone, whatever stands before it */
static block *previous;   /* while recording, the block that is being executed; else NULL */

static void *allocate(size_t size)
{
    void *const memory = calloc(1, size);
    if (memory == NULL) {
        abort();
    }
    return memory;
}

static void count_successor(block *of, uint64_t address)
{
    successor *each = of->successors;
    while ((each != NULL) && (each->address != address)) {
        each = each->next;
    }
    if (each == NULL) {
        each = allocate(sizeof *each);
        each->address = address;
        each->next = of->successors;
        of->successors = each;
    }
    ++each->count;
}

/* QEMU calls this before all that belongs to the block's instructions. */
static void on_block(unsigned int vcpu_index, void *userdata)
{
    (void)vcpu_index;
    block *const now = userdata;
    if (previous != NULL) {
        count_successor(previous, now->first);
        previous = now;
    }
}

static void record_block(struct qemu_plugin_tb *tb)
{
    const size_t count = qemu_plugin_tb_n_insns(tb);
    block *const made = allocate(sizeof *made);
    made->first = qemu_plugin_insn_vaddr(qemu_plugin_tb_get_insn(tb, 0));
    made->last = qemu_plugin_insn_vaddr(qemu_plugin_tb_get_insn(tb, count - 1));
    made->next = blocks;
    blocks = made;
    qemu_plugin_register_vcpu_tb_exec_cb(tb, on_block, CB_NO_REGS, made);
}

static void write_runs(const block *of)
{
    for (const successor *each = of->successors; each != NULL; each = each->next) {
        (void)fprintf(runs, "%" PRIx64 " %" PRIx64 " %" PRIx64 " %" PRIu64 "\n", of->first,
                      of->last, each->address, each->count);
    }
}

/* QEMU calls these before the instruction itself is counted, at begin and end alike. */
static void on_begin(unsigned int vcpu_index, void *userdata)
{
    (void)vcpu_index;
    (void)userdata;
    at_begin = executed;
    if ((runs != NULL) && (pass >= first_pass) && (pass <= last_pass)) {
        previous = &begin_block;
    }
}

static void on_end(unsigned int vcpu_index, void *userdata)
{
    (void)vcpu_index;
    (void)userdata;
    (void)fprintf(output, "%" PRIu64 "\n", executed - at_begin);
    previous = NULL;
    ++pass;
}

static void on_translate(qemu_plugin_id_t id, struct qemu_plugin_tb *tb)
{
    (void)id;
    if (runs != NULL) {
        record_block(tb);
    }
    const size_t count = qemu_plugin_tb_n_insns(tb);
    for (size_t i = 0; i < count; ++i) {
        struct qemu_plugin_insn *const insn = qemu_plugin_tb_get_insn(tb, i);
        const uint64_t address = qemu_plugin_insn_vaddr(insn);
        if (address == begin_address) {
            qemu_plugin_register_vcpu_insn_exec_cb(insn, on_begin, CB_NO_REGS, NULL);
        }
        if (address == end_address) {
            qemu_plugin_register_vcpu_insn_exec_cb(insn, on_end, CB_NO_REGS, NULL);
        }
        qemu_plugin_register_vcpu_insn_exec_inline(insn, INLINE_ADD_U64, &executed, 1);
    }
}

static void on_finish(qemu_plugin_id_t id, void *userdata)
{
    (void)id;
    (void)userdata;
    (void)fclose(output);
    if (runs != NULL) {
        write_runs(&begin_block);
        for (const block *each = blocks; each != NULL; each = each->next) {
            write_runs(each);
        }
        (void)fclose(runs);
    }
}

/* The text after `key` if the argument begins with it, else NULL. */
static const char *value_of(const char *const argument, const char *const key)
{
    const size_t length = strlen(key);
    return (strncmp(argument, key, length) == 0) ? &argument[length] : NULL;
}

EXPORT extern int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t *info, int argc,
                                      char **argv);

int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t *info, int argc, char **argv)
{
    (void)info;
    const char *runs_name = NULL;
    for (int i = 0; i < argc; ++i) {
        const char *const begin = value_of(argv[i], "begin=");
        const char *const end = value_of(argv[i], "end=");
        const char *const out = value_of(argv[i], "out=");
        const char *const record = value_of(argv[i], "runs=");
        const char *const first = value_of(argv[i], "first=");
        const char *const last = value_of(argv[i], "last=");
        if (begin != NULL) {
            begin_address = strtoull(begin, NULL, 0);
        } else if (end != NULL) {
            end_address = strtoull(end, NULL, 0);
        } else if (out != NULL) {
            output = fopen(out, "w");
        } else if (record != NULL) {
            runs_name = record;
        } else if (first != NULL) {
            first_pass = strtoull(first, NULL, 0);
        } else if (last != NULL) {
            last_pass = strtoull(last, NULL, 0);
        } else {
            (void)fprintf(stderr, "instruction counter: unknown argument %s\n", argv[i]);
            return 1;
        }
    }
    if (runs_name != NULL) {
        runs = fopen(runs_name, "w");
    }
    if ((begin_address == 0) || (end_address == 0) || (output == NULL) ||
        ((runs_name != NULL) && (runs == NULL))) {
        (void)fputs("instruction counter: needs begin=, end=, writable out= and runs=\n", stderr);
        return 1;
    }
    begin_block.first = begin_address;
    begin_block.last = begin_address;
    qemu_plugin_register_vcpu_tb_trans_cb(id, on_translate);
    qemu_plugin_register_atexit_cb(id, on_finish, NULL);
    return 0;
}
