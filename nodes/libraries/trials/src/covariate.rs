//! What the leftover of an effect goes with, by the physics of its class: for judging how an unknown is described.
//!
//! | class | goes with |
//! |---|---|
//! | `backlash`, `reversal_spike` | the way since its axis' reversal, or the sense of rotation with the angle |
//! | `scale_error`, `squareness`, `pitch_error`, `straightness`, `angular_error`, `cyclic_error` | the position of the axis that moves, or the angle |
//! | `servo_lag` | the velocity of its axis, or the sense of rotation with the angle |
//! | `clock_offset` | any velocity, or the sense of rotation with the angle |
//! | `probe_latency` | the feed of the touches |
//! | `length_wavelength` | any position |
//! | `screw_elongation` | time, a temperature, or the position of its axis |
//! | `drive_windup` | acceleration, which on a circle is position and angle |
//! | `plate_error` | any position, or the angle |
//! | `clock_drift` | any velocity, the sense of rotation with the angle, or time |
//! | `probe_lobing`, `probe_pretravel` | the angle of the approach, or the stylus |
//! | `latency_jitter` | the feed of the touches |
//! | `interpolation_error` | the position of its axis, or the angle |
//! | `rotary_location`, `rotary_motion`, `rotary_backlash` | the position of its axis, or the angle of the approach |
//! | `spindle_growth`, `column_bend`, `ambient_drift` | time, or a temperature |

use crate::effect::Class;
use crate::truth::TrueEffect;

/// Whether a covariate of a report is one that an effect goes with.
#[must_use]
pub fn is_right(effect: &TrueEffect, covariate: &str) -> bool {
    let moving = effect.axis.chars().last().unwrap_or(' ');
    let of_axis = |what: &str| covariate == format!("{what}_{}", moving.to_ascii_lowercase());
    match effect.class {
        Class::Backlash | Class::ReversalSpike => {
            of_axis("sense*log_distance_since_reversal") || covariate == "sense*angle"
        }
        Class::ScaleError
        | Class::Squareness
        | Class::PitchError
        | Class::Straightness
        | Class::AngularError
        | Class::CyclicError
        | Class::DriveWindup => of_axis("position") || covariate == "angle",
        Class::ServoLag => of_axis("velocity") || covariate == "sense*angle",
        Class::ClockOffset => covariate.starts_with("velocity_") || covariate == "sense*angle",
        Class::ProbeLatency => covariate == "feed",
        Class::LengthWavelength => covariate.starts_with("position_"),
        Class::PlateError => covariate.starts_with("position_") || covariate == "angle",
        Class::ClockDrift => {
            covariate.starts_with("velocity_") || ["sense*angle", "time"].contains(&covariate)
        }
        Class::ProbeLobing | Class::ProbePretravel => {
            ["approach_angle", "stylus"].contains(&covariate)
        }
        Class::LatencyJitter => covariate == "feed",
        Class::InterpolationError => of_axis("position") || covariate == "angle",
        Class::RotaryLocation | Class::RotaryMotion | Class::RotaryBacklash => {
            of_axis("position") || covariate == "approach_angle"
        }
        Class::SpindleGrowth | Class::ColumnBend | Class::AmbientDrift => {
            covariate == "time" || covariate.starts_with("temperature_")
        }
        Class::ScrewElongation => {
            covariate == "time" || covariate.starts_with("temperature_") || of_axis("position")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_play_goes_with_reversals_of_its_own_axis_and_a_lean_with_the_axis_that_leans() {
        let effect = |class: Class, axis: &str| TrueEffect {
            class,
            axis: axis.to_owned(),
            size: 1.0,
            unit: String::new(),
            parameter: None,
            is_foreign: false,
            besides: vec![],
            d: 10.0,
            common_d: None,
        };
        let play = effect(Class::Backlash, "Y");
        assert!(is_right(&play, "sense*log_distance_since_reversal_y"));
        assert!(!is_right(&play, "sense*log_distance_since_reversal_x"));
        assert!(!is_right(&play, "position_y"));
        let lean = effect(Class::Squareness, "XZ");
        assert!(is_right(&lean, "position_z") && !is_right(&lean, "position_x"));
        let beam = effect(Class::LengthWavelength, "");
        assert!(is_right(&beam, "position_x") && !is_right(&beam, "time"));
    }
}
