//! What is put on the machine to measure it: putting it up, zeroing and reading.

use super::Plant;
use super::chain::Rigid;
use super::grid_plate::GridReading;
use super::laser::LengthReading;

impl Plant {
    /// Whether the machine file has a placement or beam `id`.
    #[must_use]
    pub fn has_device(&self, id: &str) -> bool {
        self.plate.as_ref().is_some_and(|plate| plate.has(id))
            || self.laser.as_ref().is_some_and(|laser| laser.has(id))
    }

    /// Puts the plate or the laser at the placement or beam `id`; nothing where it is unknown.
    pub fn mount(&mut self, id: &str) {
        if let Some(plate) = self.plate.as_mut().filter(|plate| plate.has(id)) {
            plate.mount(id);
        }
        if let Some(laser) = self.laser.as_mut().filter(|laser| laser.has(id)) {
            laser.mount(id);
        }
    }

    /// Sets the grid encoder's count to zero where its head is.
    pub fn zero_grid(&mut self) {
        let tool = self.tool();
        if let Some(plate) = &mut self.plate {
            plate.zero(&tool, &self.structure);
        }
    }

    /// Sets the length reference's count to zero where its reflector is.
    pub fn zero_length(&mut self) {
        let (tool, elapsed_s) = (self.tool(), self.elapsed.as_secs_f64());
        if let Some(laser) = &mut self.laser {
            laser.zero(&tool, &self.structure, elapsed_s);
        }
    }

    /// Whether a grid plate is mounted.
    pub fn has_grid(&self) -> bool {
        self.plate.as_ref().is_some_and(|plate| plate.is_mounted())
    }

    /// Whether a beam of the length reference is mounted.
    pub fn has_length(&self) -> bool {
        self.laser.as_ref().is_some_and(|laser| laser.is_mounted())
    }

    /// Reads the grid encoder; `None` where it is not mounted or has no count.
    pub fn grid_reading(&mut self) -> Option<GridReading> {
        if !self.plate.as_ref()?.is_mounted() {
            return None;
        }
        let tool = self.tool();
        self.plate.as_mut()?.read(&tool, &self.structure)
    }

    /// Reads the length reference; `None` where it is not mounted or has no count.
    pub fn length_reading(&mut self) -> Option<LengthReading> {
        if !self.laser.as_ref()?.is_mounted() {
            return None;
        }
        let (tool, elapsed_s) = (self.tool(), self.elapsed.as_secs_f64());
        self.laser.as_mut()?.read(&tool, &self.structure, elapsed_s)
    }

    fn tool(&self) -> Rigid {
        self.body
            .workpiece_from_tool(&self.true_slide(), &self.structure)
    }
}
