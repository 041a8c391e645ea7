//! Whole bags: written, read, damaged, filled up, and read by others.

#![expect(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "tests write, damage and read files, and stop at the first surprise"
)]

mod damage;
mod foreign;
mod full_disk;
mod machine_file;
#[cfg(feature = "peers")]
mod peers;
mod queue;
mod reflect;
mod ring;
mod sample;
mod storage;
mod write_and_read;
