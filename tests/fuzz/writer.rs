//! What `abbe import` would write, counted.

use anyhow::{Result, bail};
use metrology::sample::{ProbedFeature, ProbedPoint, TestSegment};
use metrology::stamp::Span;
use metrology::{Axis, Host, PerAxis, Stamp};

/// Counts messages and keeps the time.
#[derive(Default)]
pub struct Writer {
    start: Stamp<Host>,
    at: Stamp<Host>,
    messages: u64,
}

/// A run of a day at a hundred states a second has fewer.
const MOST_MESSAGES: u64 = 20_000_000;

impl Writer {
    fn write(&mut self) -> Result<()> {
        self.messages += 1;
        assert!(self.messages < MOST_MESSAGES, "a motion without end");
        Ok(())
    }

    pub fn wait(&mut self, time_s: f64) {
        self.at += Span::from_secs_f64(time_s);
    }

    pub fn begin_row(&mut self, time_s: f64) -> Result<()> {
        let at = self.start + Span::from_secs_f64(time_s);
        if at < self.at {
            bail!("time {time_s} s: must not be before the row above");
        }
        self.at = at;
        Ok(())
    }

    pub fn tick(&mut self, _: &PerAxis<f64>) -> Result<()> {
        self.write()
    }

    pub fn length(&mut self, axis: Axis, displacement_mm: f64) -> Result<()> {
        self.length_of((axis, 1), displacement_mm)
    }

    pub fn length_of(&mut self, _: (Axis, u32), _: f64) -> Result<()> {
        self.write()
    }

    pub fn angle(&mut self, _: Axis, _: f64) -> Result<()> {
        self.write()
    }

    pub fn temperature(&mut self, _: &str, _: f64) -> Result<()> {
        self.write()
    }

    pub fn touch(&mut self, _: &ProbedPoint) -> Result<()> {
        self.write()
    }

    pub fn feature(&mut self, _: &ProbedFeature) -> Result<()> {
        self.write()
    }

    pub fn segment(&mut self, _: &TestSegment, _: bool) -> Result<()> {
        self.write()
    }
}
