//! The files of `abbe import`, with a writer that only counts.
#![cfg_attr(
    test,
    expect(
        dead_code,
        reason = "the unit tests of these files run with their own program"
    )
)]

#[path = "../../nodes/abbe/src/import/limits.rs"]
pub mod limits;
#[path = "../../nodes/abbe/src/import/map.rs"]
pub mod map;
#[path = "../../nodes/abbe/src/import/motion.rs"]
pub mod motion;
#[path = "../../nodes/abbe/src/import/table.rs"]
pub mod table;
#[path = "writer.rs"]
pub mod writer;
