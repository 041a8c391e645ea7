//! When a shift of four hours tests and when it produces.
//!
//! Circles at its beginning, in its middle and at its end; blocks every 15 to 30 min; production between. Tests are fine,
//! everything else is coarse: that is what makes hundreds of shifts quick.

use std::f64::consts::{FRAC_PI_2, TAU};

use rand::Rng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

use super::super::ballbar::{Mounted, PLANES};
use super::super::dice::log_uniform;
use super::super::machine_motion::Circle;

/// Middle of the circles, mm.
pub const CENTRE_MM: [f64; 3] = [0.0, 0.0, 190.0];
/// Length of a shift, s.
pub const SHIFT_S: f64 = 4.0 * 3600.0;
/// Shortest and longest time between two block cycles, s.
const EVERY_S: [f64; 2] = [900.0, 1800.0];
/// Time that a person needs to mount the bar in another plane, s.
const MOUNTING_IN_SHIFT_S: f64 = 150.0;
/// Rest before a circle, s.
const REST_S: f64 = 3.0;
/// Time from one touch to the next, s.
const TOUCH_EVERY_S: f64 = 6.0;
/// Angle that a circle runs ahead of its first reading, rad.
pub const AHEAD_RAD: f64 = FRAC_PI_2;
/// Time before the first test, s.
const FIRST_S: f64 = 40.0;

/// A block on the table: corner, mm, and the sense in which each face is touched.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Its name.
    pub id: &'static str,
    /// Its corner, mm.
    pub corner_mm: [f64; 3],
    /// Sense of each approach.
    pub senses: [f64; 3],
}

/// One touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touched {
    /// Which block.
    pub block: usize,
    /// Which axis.
    pub axis: usize,
    /// When, s since the first state.
    pub at_s: f64,
}

/// A circle with its run.
#[derive(Clone, Debug)]
pub struct Turn {
    /// Number of its run.
    pub run: u32,
    /// Which of the three visits of the bar.
    pub visit: u32,
    /// Which of the planes.
    pub plane: usize,
    /// The circle.
    pub circle: Circle,
    /// Its begin and end, s.
    pub span_s: [f64; 2],
}

/// A block cycle.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// Number of its run.
    pub run: u32,
    /// Its touches, in time.
    pub touches: Vec<Touched>,
    /// Its begin and end, s.
    pub span_s: [f64; 2],
}

/// What follows one another in a shift.
#[derive(Clone, Debug)]
pub enum Entry {
    /// A circle of the bar.
    Turn(Turn),
    /// All faces of the blocks.
    Cycle(Cycle),
    /// Work: number of the run, begin and end, s.
    Production(u32, [f64; 2]),
}

/// A whole shift.
#[derive(Clone, Debug)]
pub struct Timetable {
    /// Blocks on the table.
    pub blocks: Vec<Block>,
    /// Everything, in time.
    pub entries: Vec<Entry>,
    /// Circles of one visit, by mounting and feed.
    pub tables: Vec<Mounted>,
}

/// A shift that is being planned.
struct Planned {
    now_s: f64,
    run: u32,
    visit: u32,
    touches_of_face: usize,
    table: Timetable,
}

impl Timetable {
    /// Draws one.
    pub fn draw(random: &mut Pcg64Mcg) -> Self {
        let table = Self {
            blocks: blocks(random),
            entries: vec![],
            tables: tables(random),
        };
        let mut planned = Planned {
            now_s: FIRST_S,
            run: 0,
            visit: 0,
            touches_of_face: random.random_range(1..=2),
            table,
        };
        let every_s = random.random_range(EVERY_S[0]..EVERY_S[1]);
        planned.visit();
        planned.cycle();
        let mut next_s = planned.now_s + every_s;
        while next_s < SHIFT_S {
            if planned.visit == 1 && next_s > 0.45 * SHIFT_S {
                planned.produce(next_s - planned.visit_s());
                planned.visit();
            } else {
                planned.produce(next_s);
            }
            planned.cycle();
            next_s = planned.now_s + every_s * random.random_range(0.85..1.15);
        }
        planned.produce(SHIFT_S);
        planned.cycle();
        planned.visit();
        planned.table
    }

    /// Its circles.
    pub fn turns(&self) -> impl Iterator<Item = &Turn> {
        self.entries.iter().filter_map(|entry| match entry {
            Entry::Turn(turn) => Some(turn),
            _ => None,
        })
    }

    /// Its block cycles.
    pub fn cycles(&self) -> impl Iterator<Item = &Cycle> {
        self.entries.iter().filter_map(|entry| match entry {
            Entry::Cycle(cycle) => Some(cycle),
            _ => None,
        })
    }

    /// Its touches, in time.
    pub fn touches(&self) -> impl Iterator<Item = &Touched> {
        self.cycles().flat_map(|cycle| &cycle.touches)
    }

    /// End of everything, s.
    pub fn end_s(&self) -> f64 {
        self.entries.last().map_or(0.0, |entry| entry.span_s()[1])
    }

    /// Number and begin of every test.
    pub fn begins_s(&self) -> Vec<(u32, f64)> {
        let of = |entry: &Entry| match entry {
            Entry::Turn(turn) => Some((turn.run, turn.span_s[0])),
            Entry::Cycle(cycle) => Some((cycle.run, cycle.span_s[0])),
            Entry::Production(..) => None,
        };
        self.entries.iter().filter_map(of).collect()
    }

    /// Longest time from one block cycle to the next, s.
    pub fn cycle_s(&self) -> f64 {
        let begins: Vec<f64> = self.cycles().map(|cycle| cycle.span_s[0]).collect();
        let apart = begins.windows(2).map(|two| two[1] - two[0]);
        apart.fold(0.0, f64::max)
    }
}

impl Entry {
    /// Begin and end, s.
    pub const fn span_s(&self) -> [f64; 2] {
        match self {
            Self::Turn(turn) => turn.span_s,
            Self::Cycle(cycle) => cycle.span_s,
            Self::Production(_, span_s) => *span_s,
        }
    }
}

impl Planned {
    const fn next_run(&mut self) -> u32 {
        self.run += 1;
        self.run
    }

    fn produce(&mut self, until_s: f64) {
        if until_s > self.now_s + 60.0 {
            let run = self.next_run();
            let span_s = [self.now_s + 5.0, until_s - 5.0];
            self.table.entries.push(Entry::Production(run, span_s));
            self.now_s = until_s;
        }
    }

    /// How long a visit takes, s.
    fn visit_s(&self) -> f64 {
        let tables = &self.table.tables;
        let circles = tables.iter().flat_map(|mounted| &mounted.circles);
        let turning_s =
            circles.map(|circle| REST_S + (TAU + AHEAD_RAD) * circle.radius_mm / circle.feed_mm_s);
        let mountings = tables.chunk_by(|a, b| a.plane == b.plane).count() + 1;
        turning_s.sum::<f64>() + MOUNTING_IN_SHIFT_S * mountings as f64
    }

    fn visit(&mut self) {
        self.visit += 1;
        let mut plane_before = None;
        for mounted in self.table.tables.clone() {
            if plane_before.replace(mounted.plane) != Some(mounted.plane) {
                self.now_s += MOUNTING_IN_SHIFT_S;
            }
            for circle in mounted.circles {
                let run = self.next_run();
                let begin_s = self.now_s + REST_S;
                let way_mm = (TAU + AHEAD_RAD) * circle.radius_mm;
                let span_s = [begin_s, begin_s + way_mm / circle.feed_mm_s];
                self.now_s = span_s[1];
                self.table.entries.push(Entry::Turn(Turn {
                    run,
                    visit: self.visit,
                    plane: mounted.plane,
                    circle,
                    span_s,
                }));
            }
        }
        self.now_s += MOUNTING_IN_SHIFT_S;
    }

    fn cycle(&mut self) {
        let run = self.next_run();
        let begin_s = self.now_s + REST_S;
        let mut at_s = begin_s;
        let mut touches = vec![];
        for block in 0..self.table.blocks.len() {
            for axis in 0..3 {
                for _ in 0..self.touches_of_face {
                    at_s += TOUCH_EVERY_S;
                    touches.push(Touched { block, axis, at_s });
                }
            }
        }
        let span_s = [begin_s, at_s + REST_S];
        self.now_s = span_s[1];
        self.table.entries.push(Entry::Cycle(Cycle {
            run,
            touches,
            span_s,
        }));
    }
}

fn blocks(random: &mut Pcg64Mcg) -> Vec<Block> {
    let mut near = |middle: f64| (middle + random.random_range(-30.0..30.0)).round();
    let mut blocks = vec![
        Block {
            id: "block_1",
            corner_mm: [near(-220.0), near(-160.0), near(30.0)],
            senses: [1.0, 1.0, -1.0],
        },
        Block {
            id: "block_2",
            corner_mm: [near(220.0), near(160.0), near(200.0)],
            senses: [-1.0, -1.0, -1.0],
        },
    ];
    // One of four shops has a single block.
    if random.random::<f64>() < 0.25 {
        let _ = blocks.pop();
    }
    blocks
}

/// Circles of one visit: one to three planes, one or two feeds, both senses.
fn tables(random: &mut Pcg64Mcg) -> Vec<Mounted> {
    let mut planes: Vec<usize> = (0..PLANES.len()).collect();
    planes.shuffle(random);
    planes.truncate(random.random_range(1..=PLANES.len()));
    planes.sort_unstable();
    let radius_mm = [100.0, 150.0][random.random_range(0..2)];
    let slow_mm_s = log_uniform(random, [15.0, 40.0]).round();
    let mut feeds = vec![slow_mm_s];
    if random.random() {
        let ratio = random.random_range(1.5..2.5);
        feeds.push((slow_mm_s * ratio).round().min(80.0));
    }
    let rows = [120, 180][random.random_range(0..2)];
    let circle = |plane: usize, feed_mm_s: f64, is_ccw: bool| {
        // Half a step off the reversals, as a bar that is not read on them.
        let angle = |row: usize| TAU * (row as f64 + 0.5) / rows as f64;
        let of_row = |row: usize| if is_ccw { angle(row) } else { TAU - angle(row) };
        Circle {
            axes: PLANES[plane].1,
            radius_mm,
            feed_mm_s,
            is_ccw,
            angles: (0..rows).map(of_row).collect(),
        }
    };
    let mut all = vec![];
    for plane in planes {
        for feed_mm_s in &feeds {
            let circles = [true, false].map(|is_ccw| circle(plane, *feed_mm_s, is_ccw));
            all.push(Mounted {
                plane,
                circles: circles.to_vec(),
            });
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn a_shift_has_three_visits_of_the_bar_and_blocks_every_half_hour_at_most() {
        for seed in 0..20 {
            let table = Timetable::draw(&mut Pcg64Mcg::seed_from_u64(seed));
            let visits: Vec<u32> = table.turns().map(|turn| turn.visit).collect();
            assert_eq!((visits[0], visits[visits.len() - 1]), (1, 3));
            assert!((5..=18).contains(&table.cycles().count()), "seed {seed}");
            assert!(table.cycle_s() < 1.3 * EVERY_S[1], "{}", table.cycle_s());
            let ends = table.entries.windows(2);
            let mut ends = ends.map(|two| two[1].span_s()[0] - two[0].span_s()[1]);
            assert!(ends.all(|rest_s| rest_s > 0.0));
            assert!((SHIFT_S..SHIFT_S + 2400.0).contains(&table.end_s()));
        }
    }
}
