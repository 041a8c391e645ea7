//! Looks after the first motion of a program in machine coordinates whether the axes are where its text says.
//!
//! The numbers of the text stand beside the positions that the loops are given, compensation aside; the encoders
//! are within the following error limit of those. While the axes move on without a stop, they are at most one
//! servo period past the end of the motion, at their speed v and acceleration a:
//!
//! ```text
//!   |x - x_text| ≤ 1e-6 + |v| T + a T²                                    (1)
//! ```

use metrology::PerAxis;

use super::Control;
use super::phase::Phase;
use crate::hardware::Hardware;
use crate::outcome::Ending;

/// Rounding of a position, mm or rad.
const ROUNDING: f64 = 1e-6;

impl<H: Hardware> Control<H> {
    /// Ends the program where the first motion led elsewhere.
    pub(super) fn verify_first_motion(&mut self) {
        let is_over = |step: usize| {
            let along = match (&self.phase, &self.rest) {
                (Phase::Following | Phase::Pausing, _) if !self.chain.done() => self.chain.tag(),
                (_, Some((_, tag))) => Some(*tag),
                _ => self.run.as_ref().map(|run| run.next),
            };
            along.is_some_and(|along| along > step)
        };
        let first = self.run.as_ref().and_then(|run| run.first_motion);
        let Some(first) = first.filter(|first| is_over(first.step)) else {
            return;
        };
        if let Some(run) = &mut self.run {
            run.first_motion = None;
        }
        if self.phase.ending() {
            return;
        }
        let period_s = self.settings.limits.period_s;
        let tolerance = PerAxis::from_fn(|axis| {
            let speed = self.command.velocity[axis].abs();
            let acceleration = self.settings.limits.acceleration[axis];
            ROUNDING + speed * period_s + acceleration * period_s * period_s // (1)
        });
        let difference = first.difference(&self.command.position, &tolerance);
        if let Some((axis, wanted, found)) = difference {
            let line = self.progress().0;
            let (scale, unit) = if axis.is_linear() {
                (1.0, "mm")
            } else {
                (1.0_f64.to_degrees(), "deg")
            };
            self.stop(Ending::FrameDiffers {
                line,
                axis,
                wanted: wanted * scale,
                found: found * scale,
                unit,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use machine::MachineFile;
    use metrology::stamp::Span;
    use metrology::{Axis, Machine, Stamp};

    use super::*;
    use crate::config::{Config, Settings};
    use crate::control::Event;
    use crate::outcome::Outcome;
    use crate::plant::{Feedback, ProbeEdge};
    use crate::rs274::Registers;

    const BENCH: &str = include_str!("../../../libraries/machine/tests/data/bench.yaml");

    /// Axes that are where their loops want them.
    struct Axes(Feedback);

    impl Hardware for Axes {
        fn step(&mut self, demand: &PerAxis<f64>, _spindle_rpm: f64, period: Span) -> Feedback {
            let period_s = period.as_secs_f64();
            for axis in Axis::ALL {
                self.0.motor[axis] +=
                    (self.0.velocity[axis] + 0.5 * demand[axis] * period_s) * period_s;
                self.0.velocity[axis] += demand[axis] * period_s;
            }
            self.0
        }
        fn feedback(&self) -> Feedback {
            self.0
        }
        fn probe_edge(&self) -> Option<ProbeEdge> {
            None
        }
        fn probe_closed(&self) -> bool {
            false
        }
        fn sensor_reading_degc(&mut self, _id: &str) -> Option<f64> {
            None
        }
        fn settle_at(&mut self, position: &PerAxis<f64>) {
            self.0.motor = *position;
        }
    }

    fn control() -> Control<Axes> {
        let machine = MachineFile::parse(BENCH, "bench.yaml").unwrap();
        let settings = Settings::new(&Config::default(), &machine).unwrap();
        let feedback = Feedback {
            motor: PerAxis::default(),
            velocity: PerAxis::default(),
            scale: PerAxis::from_fn(|_| f64::NAN),
        };
        Control::new(settings, Axes(feedback))
    }

    /// Runs `text`; the comparison expects its first motion `more` mm higher in Z.
    fn run(text: &str, more: f64) -> (Ending, Control<Axes>) {
        let mut control = control();
        control.start(1, text).unwrap();
        let first = control.run.as_mut().unwrap().first_motion.as_mut().unwrap();
        for word in first.words.0.iter_mut().flatten() {
            *word += more;
        }
        let mut events = Vec::new();
        for tick in 0..60_000 {
            let began: Stamp<Machine> = Stamp::from_nanos(tick * 1_000_000);
            control.tick(began, &mut events);
            if let Some(Event::Ended(ending)) = events.pop() {
                return (ending, control);
            }
        }
        panic!("no end of {text}");
    }

    #[test]
    fn a_machine_that_is_elsewhere_than_the_text_says_stops_before_it_goes_on() {
        let text = "(frame: machine)\nG20\nG0 Z4\nG0 X2\nG0 Z-1\nM2";
        for more in [0.01, -0.01, 10.0, 25.4 * 3.0] {
            let (ending, control) = run(text, more);
            let Ending::FrameDiffers {
                axis,
                wanted,
                found,
                ..
            } = ending.clone()
            else {
                panic!("{more}: {ending:?}");
            };
            assert_eq!((axis, ending.outcome()), (Axis::Z, Outcome::Refused));
            assert!(
                ending.to_string().contains(" mm, the machine is at "),
                "{ending}"
            );
            assert!((wanted - found - more).abs() < 1e-3);
            let at = control.commanded();
            assert!(
                (at[Axis::Z] - 101.6).abs() < 1.0 && at[Axis::X].abs() < 1.0,
                "{at:?}"
            );
            assert_eq!(*control.registers(), Registers::default());
        }
    }

    #[test]
    fn eq1_no_path_that_is_as_its_text_says_is_stopped() {
        for text in [
            "(frame: machine)\nG0 Z300\nG0 Z400\nM2",
            "(frame: machine)\nF15000 G1 Z300\nG1 Z350\nG1 Z20\nM2",
            "(frame: machine)\nG0 Z0\nG0 X200\nM2",
            "(frame: machine)\nG0 Z0 X0\nG0 Z100\nM2",
            "(frame: machine)\nG0 Z300\nG4 P0.1\nG0 Z400\nM2",
            "(frame: machine)\nG0 Z400\nM2",
            "(frame: machine)\nG0 Z0.001\nG0 Z0.002\nG0 Z400\nM2",
            "(frame: machine)\nG0 Z300 A-20\nG0 A10 X5\nF600 G38.3 X8\nM2",
            "(frame: machine)\nF10 G38.3 Z1\nG91 G0 Z1\nG90 G0 Z200\nG2 F2000 X10 R5\nM2",
        ] {
            let (ending, _) = run(text, 0.0);
            assert_eq!(ending, Ending::Done, "{text}");
        }
    }
}
