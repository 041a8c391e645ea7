//! The machine of tables for which no machine file is named: plain, with the axes and travels that the tables show.

use std::path::Path;

use abbe_msgs::topics;
use anyhow::{Context, Result, bail};
use machine::MachineFile;
use metrology::number::number;
use metrology::{Axis, PerAxis};
use recorder::{Bag, MACHINE_FILE, Order};
use replayer::reading;

use crate::import::Named;
use crate::import::plain_machine::{PlainMachine, UNKNOWN_PLACE, place_in_name};

/// Name of such a machine.
pub const NAME: &str = "unnamed_machine";
/// Begin of messages about its file.
const PLACE: &str = "the machine that is taken where none is named";
/// Travel of an axis that no table moves, mm.
const USUAL_TRAVEL_MM: [f64; 2] = [-250.0, 250.0];
/// An axis goes on for at least as much beyond what a table shows, mm.
const LEAST_BEYOND_MM: f64 = 10.0;

/// A plain machine and what was assumed of it.
pub struct Assumed {
    /// Its machine file.
    pub machine: Named,
    /// What was assumed, a line each.
    pub lines: Vec<String>,
}

/// What tables show of the machine that they were measured on.
#[derive(Default)]
pub struct Shown {
    moved: PerAxis<Option<(f64, f64)>>,
    rotary: Vec<Axis>,
    sensors: Vec<String>,
}

impl Shown {
    /// Adds a table, imported for a machine that is wide enough for any.
    ///
    /// # Errors
    /// When the bag cannot be read.
    pub fn add(&mut self, bag: &Path) -> Result<()> {
        let bag = Bag::open(bag)?;
        let attached = bag.attachment(MACHINE_FILE)?;
        let attached = attached.context("a table's bag has its machine")?;
        let machine = MachineFile::parse(&String::from_utf8_lossy(&attached.data), PLACE)?;
        for axis in machine.axis_set().iter().filter(|axis| !axis.is_linear()) {
            if !self.rotary.contains(&axis) {
                self.rotary.push(axis);
            }
        }
        for sensor in machine.temperature_sensors {
            if !self.sensors.contains(&sensor.id) {
                self.sensors.push(sensor.id);
            }
        }
        let moved = &mut self.moved;
        let reading = reading::read(
            &bag,
            Order::LogTime,
            &[topics::AXES_STATE.name],
            |mut taken| {
                let Some(state) = taken.of(&topics::AXES_STATE) else {
                    return;
                };
                for axis in Axis::LINEAR {
                    let at_mm = state.commanded[axis];
                    let (low, high) = moved[axis].unwrap_or((at_mm, at_mm));
                    moved[axis] = Some((low.min(at_mm), high.max(at_mm)));
                }
            },
        );
        let lost = reading.lines();
        if !lost.is_empty() {
            bail!("a table's bag: {}", lost.join("; "));
        }
        Ok(())
    }

    /// The machine that the tables show.
    pub fn machine(mut self) -> Assumed {
        self.rotary.sort_unstable();
        let travels_mm = Axis::LINEAR.map(|axis| travel_mm(self.moved[axis]));
        let sensors = self.sensors.iter().map(|id| {
            let place = place_in_name(id).unwrap_or(UNKNOWN_PLACE);
            (id.clone(), place)
        });
        let sensors: Vec<_> = sensors.collect();
        let text = PlainMachine {
            name: NAME,
            travels_mm,
            rotary: self.rotary,
            sensors: sensors.clone(),
        }
        .text();
        let travels = Axis::LINEAR
            .iter()
            .zip(travels_mm)
            .map(|(axis, [low, high])| format!("{axis} {} to {} mm", number(low), number(high)));
        let travels = travels.collect::<Vec<_>>().join(", ");
        let mut lines = vec![format!(
            "warning, no machine file: a plain machine is assumed ({travels}; leads of 10 mm; usual drives), so sizes that depend \
             on leads, gains or places are only as right as it; write yours with `abbe new-machine FILE` and name it with --machine"
        )];
        lines.extend(sensors.iter().map(|(id, _)| {
            match place_in_name(id) {
                Some(place) => format!(
                    "warning, thermometer {id}: taken to be at {place}, by its name; state it in the machine file"
                ),
                None => format!(
                    "warning, thermometer {id}: at no place that an effect goes by, for its name has no place; state it in the machine file"
                ),
            }
        }));
        Assumed {
            machine: Named {
                place: PLACE.to_owned(),
                text,
            },
            lines,
        }
    }
}

/// A travel that holds what was moved, in whole centimetres; of an axis that stood the usual one, and where it stood.
fn travel_mm(moved: Option<(f64, f64)>) -> [f64; 2] {
    let around = |(low, high): (f64, f64)| {
        [
            ((low - LEAST_BEYOND_MM) / 10.0).floor() * 10.0,
            ((high + LEAST_BEYOND_MM) / 10.0).ceil() * 10.0,
        ]
    };
    let [usual_low, usual_high] = USUAL_TRAVEL_MM;
    match moved {
        None => USUAL_TRAVEL_MM,
        Some((low, high)) if high > low => around((low, high)),
        Some(stood) => {
            let [low, high] = around(stood);
            [usual_low.min(low), usual_high.max(high)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_travel_holds_what_was_moved_and_is_the_usual_one_else() {
        for (moved, wanted) in [
            (Some((0.0, 500.0)), "[-10.0, 510.0]"),
            (Some((-3.5, 12.0)), "[-20.0, 30.0]"),
            (Some((100.0, 100.0)), "[-250.0, 250.0]"),
            (Some((400.0, 400.0)), "[-250.0, 410.0]"),
            (None, "[-250.0, 250.0]"),
        ] {
            assert_eq!(format!("{:?}", travel_mm(moved)), wanted);
        }
    }

    #[test]
    fn thermometers_of_a_table_have_the_place_that_their_name_tells() {
        let shown = Shown {
            sensors: vec!["spindle_nose".to_owned(), "t7".to_owned()],
            ..Shown::default()
        };
        let assumed = shown.machine();
        let machine = MachineFile::parse(&assumed.machine.text, PLACE).unwrap();
        assert_eq!(machine.temperature_sensors.len(), 2);
        assert!(assumed.lines[1].contains("at spindle_front, by its name"));
        assert!(assumed.lines[2].contains("for its name has no place"));
    }
}
