//! The tests of this crate from outside, in one program.

mod cycles;
mod frame_tree;
mod frames;
mod machine_file;
mod rotary_poses;
mod volumetric;
