/* A plugin for QEMU's user mode: instructions executed, by function. At exit
 * it prints "COUNT SYMBOL" lines; code without a symbol counts as "?".
 * Prototypes are those of QEMU's qemu-plugin.h, which Debian does not ship. */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>

typedef uint64_t qemu_plugin_id_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *, size_t);
const char *qemu_plugin_insn_symbol(const struct qemu_plugin_insn *);
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t,
    void (*)(qemu_plugin_id_t, struct qemu_plugin_tb *));
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *, int, void *, uint64_t);
void qemu_plugin_register_atexit_cb(qemu_plugin_id_t, void (*)(qemu_plugin_id_t, void *), void *);
void qemu_plugin_outs(const char *);

int qemu_plugin_version = 1;

/* Open addressing by the symbol's address, which QEMU keeps for good. */
enum { SLOTS = 1 << 16, INLINE_ADD_U64 = 0 };
static struct { const char *symbol; uint64_t count; } slots[SLOTS];

static uint64_t *count_of(const char *symbol) {
    size_t i = ((uintptr_t)symbol >> 2) % SLOTS;
    while (slots[i].symbol && slots[i].symbol != symbol) i = (i + 1) % SLOTS;
    slots[i].symbol = symbol;
    return &slots[i].count;
}

static void translated(qemu_plugin_id_t id, struct qemu_plugin_tb *block) {
    const char *symbol = qemu_plugin_insn_symbol(qemu_plugin_tb_get_insn(block, 0));
    qemu_plugin_register_vcpu_tb_exec_inline(block, INLINE_ADD_U64,
        count_of(symbol ? symbol : "?"), qemu_plugin_tb_n_insns(block));
}

static void at_exit(qemu_plugin_id_t id, void *unused) {
    char line[512];
    for (size_t i = 0; i < SLOTS; i++) {
        if (!slots[i].count) continue;
        snprintf(line, sizeof line, "%" PRIu64 " %.480s\n", slots[i].count, slots[i].symbol);
        qemu_plugin_outs(line);
    }
}

int qemu_plugin_install(qemu_plugin_id_t id, const void *info, int argc, char **argv) {
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, at_exit, NULL);
    return 0;
}
