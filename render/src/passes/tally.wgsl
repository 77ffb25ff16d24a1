// Sums of a workgroup by key, in a small open hash table: neighbours share texels and lists, and one addition to
// memory for all of them is cheaper than one for each. A key that finds no room after a few probes has no slot.
const TABLE = 256u;
const TABLE_SHIFT = 24u; // 32 - log2(TABLE)
override PROBES: u32; // 0: nobody finds a slot
const NO_SLOT = 0xffffffffu;

// Key plus one; 0 where the slot is free.
var<workgroup> tags: array<atomic<u32>, TABLE>;
var<workgroup> sums: array<atomic<u32>, TABLE>;

fn clear_table(invocation: u32) {
    for (var at = invocation; at < TABLE; at += SQUARE * SQUARE) {
        atomicStore(&tags[at], 0u);
        atomicStore(&sums[at], 0u);
    }
}

// The slot of a key, taken if it has none yet.
fn take_slot(key: u32) -> u32 {
    var slot = (key * 2654435769u) >> TABLE_SHIFT;
    for (var probe = 0u; probe < PROBES; probe++) {
        let tag = atomicLoad(&tags[slot]);
        if (tag == key + 1u) { return slot; }
        if (tag == 0u) {
            let taken = atomicCompareExchangeWeak(&tags[slot], 0u, key + 1u);
            if (taken.exchanged || taken.old_value == key + 1u) { return slot; }
        }
        slot = (slot + 1u) & (TABLE - 1u);
    }
    return NO_SLOT;
}

// The slot of a key once all slots are taken.
fn find_slot(key: u32) -> u32 {
    var slot = (key * 2654435769u) >> TABLE_SHIFT;
    for (var probe = 0u; probe < PROBES; probe++) {
        if (atomicLoad(&tags[slot]) == key + 1u) { return slot; }
        slot = (slot + 1u) & (TABLE - 1u);
    }
    return NO_SLOT;
}
