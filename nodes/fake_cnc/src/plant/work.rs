//! Work that nobody measures, in coarse steps: hours of production, and the night before a shift.
//!
//! The slides are where they are told to be; drives, loops and probe are left out. What advances is what the next
//! measurement feels of those hours: the heat of screws, guides and spindle in the steps of [`super::heat`], the machine's
//! structure with it, and what wears, dries, slips or is knocked at its time.
//!
//! # Agreement
//! `val_half_an_hour_of_strokes_in_coarse_steps_warms_as_in_servo_periods`: the growth of each screw to 3 %, places of the
//! castings to 0.01 K. Motors get no heat from accelerations.

use metrology::stamp::Span;
use metrology::{Axis, PerAxis};

use super::Plant;

impl Plant {
    /// Lets the slides go straight to `slides` (mm, rad) and the spindle turn while a step passes.
    pub fn work(&mut self, slides: &PerAxis<f64>, spindle_rpm: f64, step: Span) {
        let step_s = step.as_secs_f64();
        for axis in Axis::ALL {
            let Some(drive) = &mut self.drives[axis] else {
                continue;
            };
            let path = (slides[axis] - drive.slide).abs();
            drive.settle_at(slides[axis]);
            self.heat.rub(axis, drive.slide, path, 0.0, step_s);
        }
        self.heat.spin(spindle_rpm, step_s);
        self.body.pass(step_s);
        self.age(step);
        self.contact.forget(self.elapsed);
    }

    /// Switches the machine on or off: without current, what stands in `standing_heat_w` is cold.
    pub const fn switch(&mut self, is_on: bool) {
        self.heat.switch(is_on);
    }
}
