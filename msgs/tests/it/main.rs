//! The tests of this crate from outside, in one program.

mod bounds;
mod cdr;
mod gap;
mod geometry;
mod interface_files;
mod machine_value;
mod refusals;
mod release;
mod topics;
mod type_hashes;
mod wire;
