//! What a control can ask of the machine it drives.

use metrology::PerAxis;
use metrology::stamp::Span;

use crate::plant::{Feedback, Plant, ProbeEdge};

/// Drives, encoders, probe and sensors, one servo period at a time.
pub trait Hardware {
    /// Applies `demand` (mm/s², rad/s²) and the spindle speed (1/min) for one `period`.
    fn step(&mut self, demand: &PerAxis<f64>, spindle_rpm: f64, period: Span) -> Feedback;
    /// What the encoders say now.
    fn feedback(&self) -> Feedback;
    /// First change of the probe's signal that arrived in the period just simulated.
    fn probe_edge(&self) -> Option<ProbeEdge>;
    /// The probe's signal at the control.
    fn probe_closed(&self) -> bool;
    /// Reads the temperature sensor `id`, °C.
    fn sensor_reading_degc(&mut self, id: &str) -> Option<f64>;
    /// Position of the grid encoder's head over its plate, mm; `None` off the plate.
    fn grid_position_mm(&self) -> Option<(f64, f64)>;
    /// Puts the axes at rest at `position` (mm, rad) without a motion.
    fn settle_at(&mut self, position: &PerAxis<f64>);
}

impl Hardware for Plant {
    fn step(&mut self, demand: &PerAxis<f64>, spindle_rpm: f64, period: Span) -> Feedback {
        Self::step(self, demand, spindle_rpm, period)
    }

    fn feedback(&self) -> Feedback {
        Self::feedback(self)
    }

    fn probe_edge(&self) -> Option<ProbeEdge> {
        Self::probe_edge(self)
    }

    fn probe_closed(&self) -> bool {
        Self::probe_closed(self)
    }

    fn sensor_reading_degc(&mut self, id: &str) -> Option<f64> {
        Self::sensor_reading(self, id)
    }

    fn grid_position_mm(&self) -> Option<(f64, f64)> {
        Self::grid_position(self)
    }

    fn settle_at(&mut self, position: &PerAxis<f64>) {
        Self::settle_at(self, position);
    }
}
