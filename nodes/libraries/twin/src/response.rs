//! What an effect, or all of them together, does to one run.

use metrology::{AxisSet, PerAxis};

use super::series::Series;
use super::session::Run;

/// Errors along one run; every effect adds its own part.
///
/// Vectors named per tick have the length of the run's motion, those named per touch that of its
/// touches. Unit mm (rad for rotary axes) unless said.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Response {
    /// Motor minus command, per tick: the control loop. A motor encoder, a scale and the tip see it.
    pub servo: PerAxis<Series>,
    /// Slide minus motor, per tick: screw, nut, coupling. A scale and the tip see it.
    pub drive: PerAxis<Series>,
    /// Tip relative to the workpiece beyond the slides' positions, machine frame X, Y, Z, per tick.
    pub tip_mm: [Series; 3],
    /// Reading minus position of the motor encoder, per tick.
    pub motor_reading: PerAxis<Series>,
    /// Reading minus position of the linear scale, per tick.
    pub scale_reading: PerAxis<Series>,
    /// Reading minus position of the grid encoder, first and second coordinate, per tick.
    pub grid_reading_mm: [Series; 2],
    /// Reading minus displacement of the length reference, per tick.
    pub length_reading_mm: Series,
    /// How far beyond the contact of ball and surface the position is latched, along the approach, per touch.
    pub travel_mm: Series,
    /// What an instrument itself adds to each of the run's readings, of any channel (mm, rad, K).
    pub reading: Series,
    /// Variance that an instrument itself adds to each of the run's readings, in the square of its unit.
    pub reading_variance: Series,
    /// Variance that an effect of random phase adds to the tip, machine frame X, Y, Z, per tick, mm2.
    pub tip_variance_mm2: [Series; 3],
    /// Variance along the approach, per touch, mm2.
    pub travel_variance_mm2: Series,
}

impl Response {
    /// A response of nothing, sized for a run; series of axes that the run did not record are empty.
    #[must_use]
    pub fn zero(run: &Run, axes: AxisSet) -> Self {
        let ticks = || Series::zeros(run.motion.len());
        let touches = || Series::zeros(run.touches.len());
        let readings = || Series::zeros(run.readings.len());
        let of_axis = |axis| {
            if axes.contains(axis) && run.motion.axes.contains(axis) {
                ticks()
            } else {
                Series::default()
            }
        };
        let of_axes = || PerAxis::from_fn(of_axis);
        Self {
            servo: of_axes(),
            drive: of_axes(),
            tip_mm: [ticks(), ticks(), ticks()],
            motor_reading: of_axes(),
            scale_reading: of_axes(),
            grid_reading_mm: [ticks(), ticks()],
            length_reading_mm: ticks(),
            travel_mm: touches(),
            reading: readings(),
            reading_variance: readings(),
            tip_variance_mm2: [ticks(), ticks(), ticks()],
            travel_variance_mm2: touches(),
        }
    }
}
