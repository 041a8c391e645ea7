//! Pairs readings with positions and keeps the count of what is wrong with them.
//!
//! A recording is refused by name where what it would give is no recording of one thing: two zeros in
//! it, readings of another plane, too few points, a hole, the head off its plate, the program broken off.

use std::collections::VecDeque;

use metrology::sample::{GridSample, TestPlane};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use super::place::in_plane;
use crate::diagnostic::Refusal;

/// Readings that are kept in case they belong to the next recording.
const KEPT: usize = 1_000;

/// One reading with the positions of the axes at its instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// When it was read.
    pub at: Stamp<Host>,
    /// What the grid read along u and v, mm.
    pub reading_mm: [f64; 2],
    /// Commanded positions, compensation not included, mm and rad.
    pub commanded: PerAxis<f64>,
    /// Positions that the fit takes for where the axes were, mm and rad.
    pub positions: PerAxis<f64>,
    /// Speed of the command, mm/s.
    pub commanded_speed_mm_s: f64,
    /// Velocity of `positions`, linear axes, mm/s.
    pub velocity_mm_s: Vector3<f64>,
    /// Sense in which each linear axis was commanded last: −1, 0, 1.
    pub sense: Vector3<f64>,
}

impl Pair {
    /// Whether the command stands still.
    #[must_use]
    pub fn is_standing(&self, standstill_mm_s: f64) -> bool {
        self.commanded_speed_mm_s < standstill_mm_s
    }
}

/// The pairs of one recording as they come.
#[derive(Clone, Debug, PartialEq)]
pub struct Collector {
    plane: TestPlane,
    zero_id: u32,
    limit: usize,
    pairs: Vec<Pair>,
    /// The first reading under another zero, and which.
    other_zero: Option<(Stamp<Host>, u32)>,
    /// The first reading in another plane.
    other_plane: Option<Stamp<Host>>,
    /// The last of both: they may be the next recording's.
    foreign: VecDeque<GridSample>,
    n_not_finite: usize,
    n_beyond_limit: usize,
    /// The newest reading: when it was read, and what.
    newest: Option<(Stamp<Host>, [f64; 2])>,
    n_told_before: usize,
}

impl Collector {
    /// For a recording in `plane` under zero `zero_id`, of at most `limit` pairs.
    #[must_use]
    pub fn new(plane: TestPlane, zero_id: u32, limit: usize) -> Self {
        Self {
            plane,
            zero_id,
            limit,
            pairs: Vec::new(),
            other_zero: None,
            other_plane: None,
            foreign: VecDeque::new(),
            n_not_finite: 0,
            n_beyond_limit: 0,
            newest: None,
            n_told_before: 0,
        }
    }

    /// Whether a reading belongs here; what is wrong with it is remembered.
    pub fn accepts(&mut self, sample: &GridSample) -> bool {
        if sample.plane != self.plane {
            self.other_plane.get_or_insert(sample.at);
            self.keep_foreign(sample);
        } else if sample.zero_id != self.zero_id {
            self.other_zero.get_or_insert((sample.at, sample.zero_id));
            self.keep_foreign(sample);
        } else if !(sample.u_mm.is_finite() && sample.v_mm.is_finite()) {
            self.n_not_finite += 1;
        } else {
            return self.is_new(sample);
        }
        false
    }

    fn keep_foreign(&mut self, sample: &GridSample) {
        if self.foreign.len() == KEPT {
            self.foreign.pop_front();
        }
        self.foreign.push_back(*sample);
    }

    /// Whether a reading is neither told again nor older than one before it.
    fn is_new(&mut self, sample: &GridSample) -> bool {
        let told = (sample.at, [sample.u_mm, sample.v_mm]);
        let is_new = self
            .newest
            .is_none_or(|newest| told.0 > newest.0 || (told.0 == newest.0 && told != newest));
        if is_new {
            self.newest = Some(told);
        } else {
            self.n_told_before += 1;
        }
        is_new
    }

    /// Takes out the readings after `end`.
    pub fn end(&mut self, end: Stamp<Host>, beyond: &mut impl FnMut(GridSample)) {
        let (plane, zero_id) = (self.plane, self.zero_id);
        self.pairs.retain(|pair| {
            let [u_mm, v_mm] = pair.reading_mm;
            if pair.at > end {
                beyond(GridSample {
                    at: pair.at,
                    plane,
                    u_mm,
                    v_mm,
                    zero_id,
                });
            }
            pair.at <= end
        });
        for sample in self.foreign.drain(..).filter(|sample| sample.at > end) {
            beyond(sample);
        }
        self.other_zero = self.other_zero.filter(|(at, _)| *at <= end);
        self.other_plane = self.other_plane.filter(|at| *at <= end);
    }

    /// Readings that were told again, or after a later one.
    #[must_use]
    pub fn n_told_before(&self) -> usize {
        self.n_told_before
    }

    /// Adds a pair; one with a number that is not finite is counted instead.
    pub fn push(&mut self, pair: Pair) {
        let axes = Axis::ALL.into_iter();
        let finite = axes
            .filter(|axis| axis.is_linear())
            .all(|axis| pair.positions[axis].is_finite() && pair.commanded[axis].is_finite());
        if !finite {
            self.n_not_finite += 1;
        } else if self.pairs.len() >= self.limit {
            self.n_beyond_limit += 1;
        } else {
            self.pairs.push(pair);
        }
    }

    /// The pairs so far.
    #[must_use]
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Readings that were not finite.
    #[must_use]
    pub fn n_not_finite(&self) -> usize {
        self.n_not_finite
    }

    /// Why this is no recording of one thing.
    #[must_use]
    pub fn refusals(&self, gap_limit: Span, plate_radius_mm: f64) -> Vec<Refusal> {
        let mut refusals = Vec::new();
        if let Some((_, found)) = self.other_zero {
            refusals.push(Refusal::MixedZeroIds {
                expected: self.zero_id,
                found,
            });
        }
        if self.other_plane.is_some() {
            refusals.push(Refusal::WrongPlane {
                expected: self.plane,
            });
        }
        if self.n_beyond_limit > 0 {
            refusals.push(Refusal::TooManyReadings {
                limit: self.limit,
                n_beyond: self.n_beyond_limit,
            });
        }
        if self.n_not_finite > self.pairs.len() {
            refusals.push(Refusal::NotFinite {
                n: self.n_not_finite,
                of: self.n_not_finite + self.pairs.len(),
            });
        }
        if self.pairs.is_empty() {
            refusals.push(Refusal::NoReadings);
            return refusals;
        }
        let gaps = self.pairs.windows(2).map(|two| two[1].at - two[0].at);
        if let Some(longest) = gaps.max().filter(|longest| *longest > gap_limit) {
            refusals.push(Refusal::Gap {
                longest_s: longest.as_secs_f64(),
                limit_s: gap_limit.as_secs_f64(),
            });
        }
        let reach_mm = self.reach_mm();
        if reach_mm > plate_radius_mm {
            refusals.push(Refusal::OffPlate {
                reach_mm,
                plate_radius_mm,
            });
        }
        refusals
    }

    /// Half of the longest way across the recorded field along u, v and both diagonals, mm.
    fn reach_mm(&self) -> f64 {
        let half_root = std::f64::consts::FRAC_1_SQRT_2;
        let directions = [
            [1.0, 0.0],
            [0.0, 1.0],
            [half_root, half_root],
            [half_root, -half_root],
        ];
        let across = directions.map(|[a, b]| {
            let along = self.pairs.iter().map(|pair| {
                let [u, v] = in_plane(self.plane, &pair.positions.xyz());
                a * u + b * v
            });
            let (least, greatest) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, g), x| {
                (l.min(x), g.max(x))
            });
            (greatest - least) / 2.0
        });
        across.into_iter().fold(0.0, f64::max)
    }
}
