//! The forward model of a machine tool, as simulator, compensation and diagnosis share it.
//!
//! `file` reads the machine file, which describes a machine as its maker would. The kinematic chain
//! and the test programs (touch, block, plane, bore, sphere) stand beside it.

pub mod file;

pub use file::MachineFile;
