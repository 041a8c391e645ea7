//! The slow past: means of motion and temperature on a coarse grid of time.
//!
//! # Temperatures between their readings
//!
//! The readings of a thermometer in one entry are one point, their mean at their mean time. At the middle of each entry
//! stands what goes evenly from point to point; before the first nothing is known, after the last it stays. Nothing is held
//! until the next reading: of a thermometer that is read once a minute that would be half a minute late, and of one that is
//! not read at night a warm machine until the morning. Pauses, in which nothing at all was recorded, and the spans in which
//! a thermometer alone was silent are kept beside it.

use std::collections::BTreeMap;
use std::ops::Range;

use machine::MachineFile;
use metrology::{Axis, AxisSet, PerAxis};
use twin::{History, Rubbing, rubbing::ZONES};

use crate::search::rows::count;

/// Entries of the history: 31 days of 10 s, 110 MB. A machine that runs for longer has long forgotten its first day.
const MOST_CELLS: usize = 267_840;
/// Thermometers: machines have tens, and anybody may name one in a message.
const MOST_SENSORS: usize = 200;

/// A hole beyond which nothing is said of the motion in it, s.
const PAST_HOLE_S: f64 = 2.0;
/// A silence of more than so many of the usual spacings is a pause.
const PAUSE_SPACINGS: usize = 10;

#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    time_s: f64,
    position_s: PerAxis<f64>,
    way: PerAxis<f64>,
    way_speed: PerAxis<f64>,
    way_by_zone: [[f64; ZONES]; 3],
    /// Whether a commanded position is stamped in it.
    is_told: bool,
}

/// Readings of one thermometer in one entry: sum, degC, their number, and the sum of their times since its begin, s.
#[derive(Clone, Copy, Debug, Default)]
struct Readings {
    sum_degc: f64,
    count: u32,
    since_s: f32,
}

/// Gathers the history while samples come.
#[derive(Clone, Debug)]
pub(super) struct Past {
    step_s: f64,
    /// Of X, Y, Z; what the machine lacks has none.
    travels_mm: [Option<[f64; 2]>; 3],
    cells: Vec<Cell>,
    last: Option<(f64, PerAxis<f64>)>,
    /// By sensor and cell.
    temperatures: BTreeMap<String, Vec<Readings>>,
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

    /// Whether an instant lies beyond what is held.
    pub(super) fn is_over(&self, time_s: f64) -> bool {
        self.cell(time_s) >= MOST_CELLS
    }

    /// Commanded positions at an instant; of several at one instant the first counts.
    pub(super) fn axes(&mut self, time_s: f64, position: &PerAxis<f64>) {
        if self.last.is_some_and(|(last_s, _)| time_s <= last_s) {
            return;
        }
        let before = self.last.replace((time_s, *position));
        let at = self.cell(time_s);
        if at >= MOST_CELLS {
            return;
        }
        if self.cells.len() <= at {
            self.cells.resize(at + 1, Cell::default());
        }
        let cell = &mut self.cells[at];
        cell.is_told = true;
        let Some((before_s, before)) = before else {
            return;
        };
        let dt_s = time_s - before_s;
        if dt_s > PAST_HOLE_S {
            return;
        }
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

    /// A temperature at an instant; false where it is of one thermometer too many, or beyond what is held.
    pub(super) fn temperature(&mut self, time_s: f64, sensor: &str, degc: f64) -> bool {
        let at = self.cell(time_s);
        let is_new = !self.temperatures.contains_key(sensor);
        if at >= MOST_CELLS || (is_new && self.temperatures.len() >= MOST_SENSORS) {
            return false;
        }
        if is_new {
            self.temperatures.insert(sensor.to_owned(), vec![]);
        }
        if let Some(cells) = self.temperatures.get_mut(sensor) {
            if cells.len() <= at {
                cells.resize(at + 1, Readings::default());
            }
            let readings = &mut cells[at];
            readings.sum_degc += degc;
            readings.count += 1;
            readings.since_s += since_begin_s(time_s, at, self.step_s);
        }
        true
    }

    /// Entries in which nothing was recorded, where that is a pause.
    fn pauses(&self) -> Vec<Range<usize>> {
        let mut read: Vec<usize> = (0..self.cells.len())
            .filter(|k| self.cells[*k].is_told)
            .collect();
        for cells in self.temperatures.values() {
            read.extend((0..cells.len()).filter(|k| cells[*k].count > 0));
        }
        read.sort_unstable();
        read.dedup();
        silences(&read)
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
            let read: Vec<usize> = (0..cells.len()).filter(|k| cells[*k].count > 0).collect();
            let silences = silences(&read);
            if !silences.is_empty() {
                history.unread.insert(sensor.clone(), silences);
            }
            let series = evenly(&points(cells, self.step_s), n);
            history.temperature_degc.insert(sensor.clone(), series);
        }
        history.pauses = self.pauses();
        history
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "a part of an entry, and entries are far below 2^52"
)]
fn since_begin_s(time_s: f64, cell: usize, step_s: f64) -> f32 {
    (time_s - cell as f64 * step_s) as f32
}

/// Spans between read places, of growing `read`, that are longer than `PAUSE_SPACINGS` of the usual spacing.
fn silences(read: &[usize]) -> Vec<Range<usize>> {
    let mut spacings: Vec<usize> = read.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if spacings.is_empty() {
        return vec![];
    }
    let middle = spacings.len() / 2;
    let (_, usual, _) = spacings.select_nth_unstable(middle);
    let longest = PAUSE_SPACINGS * *usual;
    let pairs = read.windows(2);
    let long = pairs.filter(|pair| pair[1] - pair[0] > longest);
    long.map(|pair| pair[0] + 1..pair[1]).collect()
}

/// Where the readings of a thermometer are, in entries since the session began, and their mean, degC.
fn points(cells: &[Readings], step_s: f64) -> Vec<(f64, f64)> {
    let read = cells.iter().enumerate().filter(|(_, one)| one.count > 0);
    let point = |(k, one): (usize, &Readings)| {
        let n = f64::from(one.count);
        let since = f64::from(one.since_s) / (n * step_s);
        (count(k) + since, one.sum_degc / n)
    };
    read.map(point).collect()
}

/// What goes evenly from point to point, at the middles of n entries; NaN in those before that of the first.
fn evenly(points: &[(f64, f64)], n: usize) -> Vec<f64> {
    let mut next = 0;
    let at = |k: usize| {
        let middle = count(k) + 0.5;
        while points.get(next).is_some_and(|point| point.0 <= middle) {
            next += 1;
        }
        let before = next.checked_sub(1).and_then(|last| points.get(last));
        match (before, points.get(next)) {
            (Some((from, a)), Some((to, b))) => a + (b - a) * (middle - from) / (to - from),
            (Some((_, last)), None) => *last,
            // The first reading may be in the second half of its entry.
            (None, Some((from, first))) if *from < count(k + 1) => *first,
            (None, _) => f64::NAN,
        }
    };
    (0..n).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine() -> MachineFile {
        let text = include_str!("../../../libraries/trials/data/machine.yaml");
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
    fn a_past_of_months_and_thermometers_without_end_are_held_up_to_their_limits() {
        let mut past = Past::new(&machine(), 10.0);
        let far_s = 1e9;
        past.axes(far_s, &PerAxis::default());
        past.axes(far_s + 1.0, &PerAxis::default());
        assert!(past.is_over(far_s) && past.cells.is_empty());
        assert!(!past.temperature(far_s, "nut_x", 20.0));
        let taken = (0..1_000).filter(|n| past.temperature(5.0, &format!("t{n}"), 20.0));
        assert_eq!(taken.count(), MOST_SENSORS);
        assert!(
            past.temperature(15.0, "t0", 21.0),
            "one that is known goes on"
        );
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

    /// Warm-ups of two mornings, read once a minute at stamps that are off by up to 7 s: T = 20 + 6 (1 - exp(-t/1800)).
    #[test]
    fn a_temperature_goes_evenly_between_its_readings_and_over_a_night() {
        let mut past = Past::new(&machine(), 10.0);
        let warm = |since_s: f64| 20.0 + 6.0 * (1.0 - (-since_s / 1800.0).exp());
        let day_s = 86_400.0;
        for morning in [0.0, day_s] {
            for k in 0..90 {
                let since_s = 60.0 * f64::from(k) + f64::from(k * 5 % 8);
                assert!(past.temperature(morning + since_s, "nut_x", warm(since_s)));
            }
        }
        let history = past.history(AxisSet::EMPTY);
        let nut = &history.temperature_degc["nut_x"];
        // A chord of 68 s lies below the curve by 6 K (68 s)^2 / (8 (1800 s)^2) = 1.1 mK at most.
        for (k, degc) in nut.iter().enumerate().take(530) {
            let middle_s = 10.0 * (count(k) + 0.5);
            assert!((degc - warm(middle_s)).abs() < 2e-3, "{k}: {degc}");
        }
        // The last of a morning is read at 5345 s; at 43 205 s the line of the night is 37 860 s of 81 055 s on.
        let last = warm(5345.0);
        let noon = last + (20.0 - last) * 37_860.0 / 81_055.0;
        assert!((nut[4320] - noon).abs() < 1e-6, "{} {noon}", nut[4320]);
        let night = 535..8640;
        assert_eq!(history.pauses, std::slice::from_ref(&night));
        assert_eq!(history.unread["nut_x"], [night]);
    }

    #[test]
    fn a_thermometer_that_alone_is_silent_is_no_pause() {
        let mut past = Past::new(&machine(), 10.0);
        for k in 0..100 {
            let at_s = 10.0 * f64::from(k);
            let _ = past.temperature(at_s, "nut_x", 20.0);
            if !(20..60).contains(&k) {
                let _ = past.temperature(at_s, "nut_y", 0.1 * f64::from(k));
            }
        }
        let history = past.history(AxisSet::EMPTY);
        assert!(history.pauses.is_empty());
        assert_eq!(history.unread["nut_y"].first(), Some(&(20..60)));
        assert!((history.temperature_degc["nut_y"][40] - 4.05).abs() < 1e-9);
    }
}
