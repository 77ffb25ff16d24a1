// The lists of (screen tile, slice) and their entries.
struct ListParams { kernel: u32, entry_shift: u32, entry_capacity: u32, long_list: u32, depth_one: f32, rim_kept: f32, rim_added: f32 }
@group(0) @binding(24) var<uniform> lists: ListParams;

// Entries of a part of a long list: no more than make a list long, so that every cut list has two parts at least.
fn part_entries() -> u32 { return min(lists.long_list, MOST_PART_ENTRIES); }
