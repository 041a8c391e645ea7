//! Each effect of the catalogue against something outside its own formula, and all of them together.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking, and prints the figures of the modules' Agreement"
)]

mod catalogue;
mod past;
mod scene;

mod acceleration_lag;
mod ambient_drift;
mod angular_error;
mod backlash;
mod clock_drift;
mod clock_offset;
mod column_bend;
mod coolant;
mod cyclic_error;
mod drive_windup;
mod feed_lost_motion;
mod following;
mod friction_windup;
mod gravity_sag;
mod guide_bow;
mod homing_shift;
mod interpolation_error;
mod latency_drift;
mod latency_jitter;
mod latency_modes;
mod lateral_play;
mod length_misalignment;
mod length_wavelength;
mod load_deflection;
mod pitch_error;
mod plate_error;
mod probe_latency;
mod probe_lobing;
mod probe_pretravel;
mod probe_repeatability;
mod quantisation;
mod reversal_spike;
mod rotary_backlash;
mod rotary_location;
mod rotary_motion;
mod scale_error;
mod screw_elongation;
mod servo_lag;
mod spindle_growth;
mod squareness;
mod stick_slip;
mod straightness;
mod structural_ringing;
mod stylus_jump;
mod thermal_shift;
mod thermometer_lag;
mod thermometer_noise;
mod thermometer_offset;
mod vibration_random;
mod workpiece_expansion;
