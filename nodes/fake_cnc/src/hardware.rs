//! What a control can ask of the machine it drives.

use metrology::PerAxis;
use metrology::stamp::Span;

use crate::plant::{Feedback, GridReading, LengthReading, Plant, ProbeEdge};

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
    /// Puts the axes at rest at `position` (mm, rad) without a motion.
    fn settle_at(&mut self, position: &PerAxis<f64>);
    /// Whether there is a plate's placement or a beam of this name.
    fn has_device(&self, _name: &str) -> bool {
        false
    }
    /// Puts a plate or a beam in place.
    fn mount(&mut self, _name: &str) {}
    /// Sets the count of the grid encoder to zero.
    fn zero_grid(&mut self) {}
    /// Sets the count of the length reference to zero.
    fn zero_length(&mut self) {}
    /// Whether a grid plate is mounted.
    fn has_grid(&self) -> bool {
        false
    }
    /// Whether a beam is mounted.
    fn has_length(&self) -> bool {
        false
    }
    /// Reads the grid encoder; `None` without a count.
    fn grid_reading(&mut self) -> Option<GridReading> {
        None
    }
    /// Reads the length reference; `None` without a count.
    fn length_reading(&mut self) -> Option<LengthReading> {
        None
    }
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

    fn settle_at(&mut self, position: &PerAxis<f64>) {
        Self::settle_at(self, position);
    }

    fn has_device(&self, name: &str) -> bool {
        Self::has_device(self, name)
    }

    fn mount(&mut self, name: &str) {
        Self::mount(self, name);
    }

    fn zero_grid(&mut self) {
        Self::zero_grid(self);
    }

    fn zero_length(&mut self) {
        Self::zero_length(self);
    }

    fn has_grid(&self) -> bool {
        Self::has_grid(self)
    }

    fn has_length(&self) -> bool {
        Self::has_length(self)
    }

    fn grid_reading(&mut self) -> Option<GridReading> {
        Self::grid_reading(self)
    }

    fn length_reading(&mut self) -> Option<LengthReading> {
        Self::length_reading(self)
    }
}
