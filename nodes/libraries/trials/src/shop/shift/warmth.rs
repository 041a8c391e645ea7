//! What warms a machine before and during a shift, and the thermometers that are on it.
//!
//! The shift before, a night, then four hours in which production and rest take turns (`heat` integrates them in steps of
//! a second). A thermometer may be in another place than its name says: a part of what it reads is the bed's.

use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::super::heat::{Course, KEPT_S, Load, Node, blocks};
use super::timetable::{Entry, Timetable};

/// Power comes in blocks of these lengths, s.
const BLOCK_S: [f64; 2] = [500.0, 5000.0];
/// Hours of the shift before, and of the night after it.
const BEFORE_H: [f64; 2] = [0.0, 6.0];
const NIGHT_H: [f64; 2] = [4.0, 12.0];
/// Share of thermometers in a wrong place, and how much of the bed they read.
const MISPLACED: f64 = 0.25;
const OF_THE_BED: [f64; 2] = [0.3, 0.7];

/// A thermometer.
#[derive(Clone, Debug)]
pub struct Thermometer {
    /// Its name in the machine file.
    pub id: &'static str,
    /// Where it should be.
    pub node: Node,
    /// What it reads, every [`KEPT_S`] since the first state, °C.
    pub degc: Vec<f64>,
}

/// A course of heat with its thermometers.
pub struct Warmth {
    course: Course,
    /// Kept instants before the shift.
    skipped: usize,
    /// Load of the axes in every second of the shift, 0 to 1.
    pub axis_load: Vec<f64>,
    /// Thermometers that are read.
    pub thermometers: Vec<Thermometer>,
}

impl Warmth {
    /// Draws one for a shift.
    pub fn draw(random: &mut Pcg64Mcg, table: &Timetable) -> Self {
        let hours = |random: &mut Pcg64Mcg, [low, high]: [f64; 2]| {
            (random.random_range(low..high) * 180.0).round() as usize * KEPT_S as usize
        };
        let (before, night) = (hours(random, BEFORE_H), hours(random, NIGHT_H));
        let length = table.end_s() as usize + 600;
        let is_at_work = at_work(table, length);
        let mut power = |share: f64| {
            let mut all = blocks(random, before, BLOCK_S);
            all.resize(before + night, 0.0);
            let shift = blocks(random, length, BLOCK_S);
            let worked = shift.iter().zip(&is_at_work);
            all.extend(worked.map(|(power, works)| if *works { share * power } else { 0.0 }));
            all
        };
        let load = Load {
            spindle: power(1.0),
            axis: power(1.0),
        };
        let course = Course::of(random, &load);
        let mut warmth = Self {
            skipped: (before + night) / KEPT_S as usize,
            axis_load: load.axis[before + night..].to_vec(),
            course,
            thermometers: vec![],
        };
        warmth.thermometers = thermometers(random, &warmth);
        warmth
    }

    /// Temperature of a node since the first state, every [`KEPT_S`], °C.
    pub fn at(&self, node: Node) -> Vec<f64> {
        self.course.at(node)[self.skipped..].to_vec()
    }

    /// The same with what was before the shift, and how many kept instants that is.
    pub fn with_past(&self, node: Node) -> (Vec<f64>, usize) {
        (self.course.at(node), self.skipped)
    }
}

/// Whether the machine works, in every second of a shift.
fn at_work(table: &Timetable, length: usize) -> Vec<bool> {
    let mut works = vec![false; length];
    for entry in &table.entries {
        if let Entry::Production(_, [from_s, to_s]) = entry {
            let to = (*to_s as usize).min(length);
            works[(*from_s as usize).min(to)..to].fill(true);
        }
    }
    works
}

/// Name of the thermometer at a node; the axes' screws share one course of heat, that of X is read.
pub const fn id_at(node: Node) -> &'static str {
    match node {
        Node::Front => "spindle_front",
        Node::Rear => "spindle_rear",
        Node::Column => "column",
        Node::Bed => "bed",
        Node::Nut => "nut_x",
        Node::Room => "ambient",
    }
}

fn thermometers(random: &mut Pcg64Mcg, warmth: &Warmth) -> Vec<Thermometer> {
    let all = [
        (Node::Front, 0.8),
        (Node::Column, 0.7),
        (Node::Bed, 0.6),
        (Node::Nut, 0.5),
        (Node::Room, 0.8),
    ];
    let bed = warmth.at(Node::Bed);
    let mut found = vec![];
    for (node, share) in all {
        if random.random::<f64>() > share {
            continue;
        }
        let is_misplaced = random.random::<f64>() < MISPLACED;
        let of_bed = random.random_range(OF_THE_BED[0]..OF_THE_BED[1]);
        let of_bed = if is_misplaced { of_bed } else { 0.0 };
        let own = warmth.at(node);
        let read = own
            .iter()
            .zip(&bed)
            .map(|(own, bed)| own + of_bed * (bed - own));
        found.push(Thermometer {
            id: id_at(node),
            node,
            degc: read.collect(),
        });
    }
    found
}

/// Value at an instant of what is kept every [`KEPT_S`].
pub fn at(kept: &[f64], at_s: f64) -> f64 {
    let place = (at_s / KEPT_S).max(0.0);
    let k = (place as usize).min(kept.len().saturating_sub(2));
    match kept.get(k..k + 2) {
        Some([a, b]) => a + (b - a) * (place - k as f64).min(1.0),
        _ => kept.first().copied().unwrap_or(0.0),
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn a_machine_warms_in_production_and_its_temperatures_begin_with_the_shift() {
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let table = Timetable::draw(&mut random);
        let warmth = Warmth::draw(&mut random, &table);
        let front = warmth.at(Node::Front);
        assert!(front.len() as f64 * KEPT_S > table.end_s());
        let most = front.iter().fold(0.0_f64, |most, degc| most.max(*degc));
        assert!(most > front[0] + 2.0, "{most} from {}", front[0]);
        assert!((at(&[1.0, 3.0], 0.5 * KEPT_S) - 2.0).abs() < 1e-12);
        assert!((at(&[1.0, 3.0], 99.0 * KEPT_S) - 3.0).abs() < 1e-12);
    }
}
