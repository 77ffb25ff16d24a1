//! Tests of exports as others' programs read them.

mod read_back;
