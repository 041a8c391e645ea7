//! The files of `abbe import`, with a writer that only counts.
#![cfg_attr(
    test,
    expect(
        dead_code,
        unused_imports,
        reason = "the unit tests of these files run with their own program"
    )
)]

#[path = "../../nodes/abbe/src/import/again.rs"]
pub mod again;
#[path = "../../nodes/abbe/src/import/axis_names.rs"]
pub mod axis_names;
#[path = "../../nodes/abbe/src/import/beside.rs"]
pub mod beside;
#[path = "../../nodes/abbe/src/import/clock_parts.rs"]
pub mod clock_parts;
#[path = "../../nodes/abbe/src/import/columns.rs"]
pub mod columns;
#[path = "../../nodes/abbe/src/import/dates.rs"]
pub mod dates;
#[path = "../../nodes/abbe/src/import/deviation_names.rs"]
pub mod deviation_names;
#[path = "../../nodes/abbe/src/import/directions.rs"]
pub mod directions;
#[path = "../../nodes/abbe/src/import/doubled.rs"]
pub mod doubled;
#[path = "../../nodes/abbe/src/import/lacking.rs"]
pub mod lacking;
#[path = "../../nodes/abbe/src/import/laser_conditions.rs"]
pub mod laser_conditions;
#[path = "../../nodes/abbe/src/import/laser_owner.rs"]
pub mod laser_owner;
#[path = "../../nodes/abbe/src/import/laser_passes.rs"]
pub mod laser_passes;
#[path = "../../nodes/abbe/src/import/limits.rs"]
pub mod limits;
#[path = "../../nodes/abbe/src/import/listed.rs"]
pub mod listed;
#[path = "../../nodes/abbe/src/import/map.rs"]
pub mod map;
#[path = "../../nodes/abbe/src/import/map_schema.rs"]
pub mod map_schema;
#[path = "../../nodes/abbe/src/import/measured.rs"]
pub mod measured;
#[path = "../../nodes/abbe/src/import/merged.rs"]
pub mod merged;
#[path = "../../nodes/abbe/src/import/motion.rs"]
pub mod motion;
#[path = "../../nodes/abbe/src/import/odd.rs"]
pub mod odd;
#[path = "../../nodes/abbe/src/import/parted.rs"]
pub mod parted;
#[path = "../../nodes/abbe/src/import/pass_names.rs"]
pub mod pass_names;
#[path = "../../nodes/abbe/src/import/passes.rs"]
pub mod passes;
#[path = "../../nodes/abbe/src/import/probe_log.rs"]
pub mod probe_log;
#[path = "../../nodes/abbe/src/import/prose.rs"]
pub mod prose;
#[path = "../../nodes/abbe/src/import/quantities.rs"]
pub mod quantities;
#[path = "../../nodes/abbe/src/import/recognise.rs"]
pub mod recognise;
#[path = "../../nodes/abbe/src/import/renishaw_laser.rs"]
pub mod renishaw_laser;
#[path = "../../nodes/abbe/src/import/returns.rs"]
pub mod returns;
#[path = "../../nodes/abbe/src/import/runs.rs"]
pub mod runs;
#[path = "../../nodes/abbe/src/import/said_of_numbers.rs"]
pub mod said_of_numbers;
#[path = "../../nodes/abbe/src/import/same.rs"]
pub mod same;
#[path = "../../nodes/abbe/src/import/separators.rs"]
pub mod separators;
#[path = "../../nodes/abbe/src/import/shapes.rs"]
pub mod shapes;
#[path = "../../nodes/abbe/src/import/sheet.rs"]
pub mod sheet;
#[path = "../../nodes/abbe/src/import/spaced.rs"]
pub mod spaced;
#[path = "../../nodes/abbe/src/import/split_decimals.rs"]
pub mod split_decimals;
#[path = "../../nodes/abbe/src/import/stated.rs"]
pub mod stated;
#[path = "../../nodes/abbe/src/import/statement.rs"]
pub mod statement;
#[path = "../../nodes/abbe/src/import/table.rs"]
pub mod table;
#[path = "../../nodes/abbe/src/import/times.rs"]
pub mod times;
#[path = "../../nodes/abbe/src/import/touch_shapes.rs"]
pub mod touch_shapes;
#[path = "../../nodes/abbe/src/import/touches.rs"]
pub mod touches;
#[path = "../../nodes/abbe/src/import/turned.rs"]
pub mod turned;
#[path = "../../nodes/abbe/src/import/units.rs"]
pub mod units;
#[path = "../../nodes/abbe/src/import/unread.rs"]
pub mod unread;
#[path = "../../nodes/abbe/src/import/vocabulary.rs"]
pub mod vocabulary;
#[path = "writer.rs"]
pub mod writer;
