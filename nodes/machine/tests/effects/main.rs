//! Each effect of the catalogue against something outside its own formula, and all of them together.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking, and prints the figures of the modules' Agreement"
)]

mod catalogue;
mod scene;

mod acceleration_lag;
mod angular_error;
mod backlash;
mod cyclic_error;
mod following;
mod pitch_error;
mod reversal_spike;
mod scale_error;
mod servo_lag;
mod squareness;
mod straightness;
