//! What an effect, or all of them together, does to one run.

use metrology::{AxisSet, PerAxis};

use super::session::Run;

/// Errors along one run; every effect adds its own part.
///
/// Vectors named per tick have the length of the run's motion, those named per touch that of its
/// touches. Unit mm (rad for rotary axes) unless said.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Response {
    /// Motor minus command, per tick: the control loop. A motor encoder, a scale and the tip see it.
    pub servo: PerAxis<Vec<f64>>,
    /// Slide minus motor, per tick: screw, nut, coupling. A scale and the tip see it.
    pub drive: PerAxis<Vec<f64>>,
    /// Tip relative to the workpiece beyond the slides' positions, machine frame X, Y, Z, per tick.
    pub tip_mm: [Vec<f64>; 3],
    /// Reading minus position of the motor encoder, per tick.
    pub motor_reading: PerAxis<Vec<f64>>,
    /// Reading minus position of the linear scale, per tick.
    pub scale_reading: PerAxis<Vec<f64>>,
    /// Reading minus position of the grid encoder, first and second coordinate, per tick.
    pub grid_reading_mm: [Vec<f64>; 2],
    /// Reading minus displacement of the length reference, per tick.
    pub length_reading_mm: Vec<f64>,
    /// How far beyond the contact of ball and surface the position is latched, along the approach, per touch.
    pub travel_mm: Vec<f64>,
    /// What an instrument itself adds to each of the run's readings, of any channel (mm, rad, K).
    pub reading: Vec<f64>,
    /// Variance that an instrument itself adds to each of the run's readings, in the square of its unit.
    pub reading_variance: Vec<f64>,
    /// Variance that an effect of random phase adds to the tip, machine frame X, Y, Z, per tick, mm2.
    pub tip_variance_mm2: [Vec<f64>; 3],
    /// Variance along the approach, per touch, mm2.
    pub travel_variance_mm2: Vec<f64>,
}

impl Response {
    /// A response of nothing, sized for a run.
    #[must_use]
    pub fn zero(run: &Run, axes: AxisSet) -> Self {
        let ticks = || vec![0.0; run.motion.len()];
        let of_axes =
            || PerAxis::from_fn(|axis| if axes.contains(axis) { ticks() } else { vec![] });
        Self {
            servo: of_axes(),
            drive: of_axes(),
            tip_mm: [ticks(), ticks(), ticks()],
            motor_reading: of_axes(),
            scale_reading: of_axes(),
            grid_reading_mm: [ticks(), ticks()],
            length_reading_mm: ticks(),
            travel_mm: vec![0.0; run.touches.len()],
            reading: vec![0.0; run.readings.len()],
            reading_variance: vec![0.0; run.readings.len()],
            tip_variance_mm2: [ticks(), ticks(), ticks()],
            travel_variance_mm2: vec![0.0; run.touches.len()],
        }
    }
}
