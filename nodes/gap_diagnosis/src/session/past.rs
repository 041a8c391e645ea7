//! The slow past: means of motion and temperature on a coarse grid of time.

use std::collections::BTreeMap;

use machine::MachineFile;
use machine::twin::{History, Rubbing, rubbing::ZONES};
use metrology::{Axis, AxisSet, PerAxis};

/// A hole beyond which nothing is said of the motion in it, s.
const HOLE_S: f64 = 2.0;

#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    time_s: f64,
    position_s: PerAxis<f64>,
    way: PerAxis<f64>,
    way_speed: PerAxis<f64>,
    way_by_zone: [[f64; ZONES]; 3],
}

/// Gathers the history while samples come.
#[derive(Clone, Debug)]
pub(super) struct Past {
    step_s: f64,
    /// Of X, Y, Z; what the machine lacks has none.
    travels_mm: [Option<[f64; 2]>; 3],
    cells: Vec<Cell>,
    last: Option<(f64, PerAxis<f64>)>,
    /// (sum, count) per sensor and cell.
    temperatures: BTreeMap<String, Vec<(f64, u32)>>,
}

impl Past {
    pub(super) fn new(machine: &MachineFile, step_s: f64) -> Self {
        Self {
            step_s,
            travels_mm: Axis::LINEAR.map(|axis| machine.linear(axis).map(|entry| entry.travel_mm)),
            cells: vec![],
            last: None,
            temperatures: BTreeMap::new(),
        }
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "times are not negative, and days of seconds"
    )]
    fn cell(&self, time_s: f64) -> usize {
        (time_s.max(0.0) / self.step_s) as usize
    }

    /// Commanded positions at an instant; of several at one instant the first counts.
    pub(super) fn axes(&mut self, time_s: f64, position: &PerAxis<f64>) {
        if self.last.is_some_and(|(last_s, _)| time_s <= last_s) {
            return;
        }
        let Some((before_s, before)) = self.last.replace((time_s, *position)) else {
            return;
        };
        let dt_s = time_s - before_s;
        if dt_s > HOLE_S {
            return;
        }
        let at = self.cell(time_s);
        if self.cells.len() <= at {
            self.cells.resize(at + 1, Cell::default());
        }
        let cell = &mut self.cells[at];
        cell.time_s += dt_s;
        for index in 0..6 {
            let way = (position.0[index] - before.0[index]).abs();
            cell.position_s.0[index] += position.0[index] * dt_s;
            cell.way.0[index] += way;
            cell.way_speed.0[index] += way * way / dt_s;
            if let Some(Some(travel_mm)) = self.travels_mm.get(index) {
                let middle = 0.5 * (position.0[index] + before.0[index]);
                cell.way_by_zone[index][Rubbing::zone(*travel_mm, middle)] += way;
            }
        }
    }

    /// A temperature at an instant.
    pub(super) fn temperature(&mut self, time_s: f64, sensor: &str, degc: f64) {
        let at = self.cell(time_s);
        if !self.temperatures.contains_key(sensor) {
            self.temperatures.insert(sensor.to_owned(), vec![]);
        }
        if let Some(cells) = self.temperatures.get_mut(sensor) {
            if cells.len() <= at {
                cells.resize(at + 1, (0.0, 0));
            }
            cells[at].0 += degc;
            cells[at].1 += 1;
        }
    }

    /// The history so far, at least one entry. Where nothing was recorded the axes rest where they were last seen.
    pub(super) fn history(&self, axes: AxisSet) -> History {
        let n = self
            .temperatures
            .values()
            .map(Vec::len)
            .fold(self.cells.len().max(1), usize::max);
        let mut history = History {
            step_s: self.step_s,
            ..History::default()
        };
        for axis in axes.iter() {
            let mut here = self
                .cells
                .iter()
                .find(|cell| cell.time_s > 0.0)
                .map_or(0.0, |cell| cell.position_s[axis] / cell.time_s);
            for k in 0..n {
                let cell = self.cells.get(k).filter(|cell| cell.time_s > 0.0);
                here = cell.map_or(here, |cell| cell.position_s[axis] / cell.time_s);
                let mean = |sum: f64| cell.map_or(0.0, |cell| sum / cell.time_s);
                history.position[axis].push(here);
                history.speed[axis].push(mean(cell.map_or(0.0, |cell| cell.way[axis])));
                history.speed_squared[axis]
                    .push(mean(cell.map_or(0.0, |cell| cell.way_speed[axis])));
            }
        }
        for (index, axis) in Axis::LINEAR.into_iter().enumerate() {
            let Some(travel) = self.travels_mm[index].filter(|_| axes.contains(axis)) else {
                continue;
            };
            let speed = |k: usize| match self.cells.get(k).filter(|cell| cell.time_s > 0.0) {
                Some(cell) => cell.way_by_zone[index].map(|way| way / cell.time_s),
                None => [0.0; ZONES],
            };
            history.rubbing[axis] = Rubbing {
                travel,
                speed: (0..n).map(speed).collect(),
            };
        }
        for (sensor, cells) in &self.temperatures {
            let mut here = f64::NAN;
            let series = (0..n).map(|k| {
                if let Some((sum, count)) = cells.get(k).filter(|cell| cell.1 > 0) {
                    here = sum / f64::from(*count);
                }
                here
            });
            history
                .temperature_degc
                .insert(sensor.clone(), series.collect());
        }
        history
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine() -> MachineFile {
        let text = include_str!("../../../trials/data/machine.yaml");
        MachineFile::parse(text, "machine.yaml").expect("a machine file")
    }

    #[test]
    fn ways_are_told_by_the_place_where_they_were_made() {
        let mut past = Past::new(&machine(), 10.0);
        for k in 0..=40 {
            let mut position = PerAxis::default();
            position[Axis::X] = 100.0 + f64::from(k);
            past.axes(f64::from(k) * 0.25, &position);
        }
        let history = past.history(AxisSet::EMPTY.with(Axis::X));
        let [low, high] = history.rubbing[Axis::X].travel;
        let zones = history.rubbing[Axis::X].speed[0];
        let sum: f64 = zones.iter().sum();
        assert!((sum - history.speed[Axis::X][0]).abs() < 1e-9);
        let rubbed = |zone: &usize| zones[*zone] > 0.0;
        let wanted = Rubbing::zone([low, high], 100.0)..=Rubbing::zone([low, high], 140.0);
        assert!((0..ZONES).filter(rubbed).eq(wanted), "{zones:?}");
        assert!(history.rubbing[Axis::Y].speed.is_empty());
    }

    #[test]
    fn speed_and_its_square_are_means_over_the_time_that_was_recorded() {
        let mut past = Past::new(&machine(), 10.0);
        for k in 0..=40 {
            let mut position = PerAxis::default();
            position[Axis::X] = f64::from(k) * 5.0;
            past.axes(f64::from(k) * 0.5, &position);
        }
        past.temperature(12.0, "nut_x", 21.5);
        let history = past.history(AxisSet::EMPTY.with(Axis::X));
        assert_eq!(history.len(), 3);
        for k in 0..2 {
            assert!((history.speed[Axis::X][k] - 10.0).abs() < 1e-9);
            assert!((history.speed_squared[Axis::X][k] - 100.0).abs() < 1e-9);
        }
        let nut = &history.temperature_degc["nut_x"];
        assert!(nut[0].is_nan());
        assert_eq!(nut[1..], [21.5, 21.5]);
    }

    #[test]
    fn a_hole_is_rest_at_the_last_place() {
        let mut past = Past::new(&machine(), 10.0);
        let mut position = PerAxis::default();
        position[Axis::X] = 7.0;
        past.axes(0.0, &position);
        past.axes(1.0, &position);
        past.axes(35.0, &position);
        past.axes(36.0, &position);
        let history = past.history(AxisSet::EMPTY.with(Axis::X));
        assert_eq!(history.position[Axis::X], [7.0; 4]);
        assert_eq!(history.speed[Axis::X], [0.0; 4]);
    }
}
