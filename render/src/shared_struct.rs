//! The macro that declares what Rust and WGSL share, with a table to compare the two by.

/// Name, offset and Rust type of every field of a struct.
pub type Fields = &'static [(&'static str, usize, &'static str)];

/// Declares a plain `#[repr(C)]` struct of 4-byte scalars and vectors of them together with the table of its field names and offsets.
macro_rules! shared_struct {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$field_meta:meta])* pub $field:ident: $kind:ty,)* }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Debug, Clone, Copy, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind,)* }

        impl $name {
            /// Name, offset and Rust type of every field.
            pub const FIELDS: crate::shared_struct::Fields =
                &[$((stringify!($field), std::mem::offset_of!($name, $field), stringify!($kind)),)*];
        }
    };
}
