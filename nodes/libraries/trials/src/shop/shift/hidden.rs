//! What a shift can hide, as readings of size 1 on its circles and touches.
//!
//! A motion (`machine_motion`) is there always, from an instant on, or grows from one; lost motion of a worn nut varies along
//! its axis. What warms moves the tip in the direction of a touch; a screw that warms also makes circles oval. A control may
//! compensate a part of the spindle's growth already, without its lag. A reference that shifts moves one axis at all
//! blocks, a clamp that slips or a block that creeps moves one face of one block.

use std::f64::consts::TAU;

use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::super::ballbar::LETTERS;
use super::super::dice::log_uniform;
use super::super::heat::{Behind, Node};
use super::super::machine_motion::{Circle, Motion};
use super::super::truth::{Change, Name, name};
use super::timetable::{CENTRE_MM, Entry, SHIFT_S, Timetable, Touched, Turn};
use super::warmth::{Warmth, at, id_at};

/// Instants at which something begins, as shares of the shift.
const BEGINS: [f64; 2] = [0.12, 0.85];
/// Lags of what grows, s.
const LAG_S: [f64; 2] = [120.0, 5400.0];
/// Time in which a block creeps, s.
const CREEPS_S: [f64; 2] = [600.0, 7200.0];
/// Time in which lubrication fades, s.
const FADES_S: [f64; 2] = [1800.0, 7200.0];
/// Waves of a worn nut, mm.
const WEAR_MM: [f64; 2] = [80.0, 600.0];
/// What a control takes off the growth of a spindle.
const COMPENSATED: [f64; 2] = [0.3, 0.8];
/// Where the fixed bearing of a screw is, mm from the machine's zero.
const FIXED_MM: [f64; 2] = [300.0, 450.0];

/// Since when an effect is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Begins {
    /// It always was.
    Always,
    /// Suddenly at an instant, s.
    At(f64),
    /// It grows from an instant, s, for a time, s.
    Grows(f64, f64),
}

impl Begins {
    /// Share of its size at an instant, s.
    fn share(self, at_s: f64) -> f64 {
        match self {
            Self::Always => 1.0,
            Self::At(from_s) => f64::from(u8::from(at_s >= from_s)),
            Self::Grows(from_s, over_s) => ((at_s - from_s) / over_s).clamp(0.0, 1.0),
        }
    }

    const fn instant_s(self) -> Option<f64> {
        match self {
            Self::Always => None,
            Self::At(at_s) | Self::Grows(at_s, _) => Some(at_s),
        }
    }
}

/// A kind of hidden effect.
#[derive(Clone, Debug)]
pub enum Kind {
    /// What circles show.
    Drive(Motion),
    /// The spindle grows down.
    Spindle,
    /// The column bends: along Y, and a share of it along Z.
    Column(f64),
    /// The screw of an axis grows from its fixed bearing, mm.
    Screw(usize, f64),
    /// The room moves an axis.
    Air(usize),
    /// An axis counts from another place.
    Reference(usize),
    /// A clamp slips: block and axis.
    Slip(usize, usize),
    /// A block creeps: block, axis, and the time that it takes, s.
    Creep(usize, usize, f64),
}

/// How lost motion varies along an axis: share, wave, rad/mm, and phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wear([f64; 3]);

impl Wear {
    fn draw(random: &mut Pcg64Mcg) -> Self {
        Self([
            random.random_range(0.2..0.7),
            TAU / log_uniform(random, WEAR_MM),
            random.random_range(0.0..TAU),
        ])
    }

    /// Width at a place over the width on average.
    fn at(self, place_mm: f64) -> f64 {
        let Self([share, wave, phase]) = self;
        1.0 + share * (wave * place_mm + phase).sin()
    }
}

/// An effect of size 1.
#[derive(Clone, Debug)]
pub struct Effect {
    /// Which.
    pub kind: Kind,
    /// Since when.
    pub begins: Begins,
    /// What grows, K above its begin, every kept instant.
    grown_k: Vec<f64>,
    /// How lost motion varies.
    wear: Option<Wear>,
    /// What a control takes off already, K for K of the temperature itself.
    compensated: f64,
}

impl Effect {
    /// A motion: lost motion and squareness may begin, friction may grow.
    pub fn of_motion(random: &mut Pcg64Mcg, motion: Motion) -> Self {
        let chance: f64 = random.random();
        let from_s = instant_s(random);
        let over_s = log_uniform(random, FADES_S);
        let begins = match motion {
            Motion::Backlash(..) if chance < 0.5 => Begins::At(from_s),
            Motion::Squareness(_) if chance < 0.15 => Begins::At(from_s),
            Motion::Reversal(..) if chance < 0.5 => Begins::Grows(from_s, over_s),
            _ => Begins::Always,
        };
        let wear = Wear::draw(random);
        let is_worn = matches!(motion, Motion::Backlash(..)) && random.random::<f64>() < 0.4;
        Self {
            kind: Kind::Drive(motion),
            begins,
            grown_k: vec![],
            wear: is_worn.then_some(wear),
            compensated: 0.0,
        }
    }

    /// Spindle, column, screw, air, reference, clamp or block, by number below [`Effect::OTHERS`].
    pub fn other(random: &mut Pcg64Mcg, which: usize, blocks: usize, warmth: &Warmth) -> Self {
        let axis = random.random_range(0..3);
        let block = random.random_range(0..blocks);
        let from_s = instant_s(random);
        let kind = match which {
            0 => Kind::Spindle,
            1 => Kind::Column(random.random_range(0.2..0.8)),
            2 => Kind::Screw(axis, random.random_range(FIXED_MM[0]..FIXED_MM[1])),
            3 => Kind::Air(axis),
            4 => Kind::Reference(axis),
            _ if random.random() => Kind::Slip(block, axis),
            _ => Kind::Creep(block, axis, log_uniform(random, CREEPS_S)),
        };
        let begins = match kind {
            Kind::Reference(_) | Kind::Slip(..) | Kind::Creep(..) => Begins::At(from_s),
            _ => Begins::Always,
        };
        let lag_s = log_uniform(random, LAG_S);
        let takes_off = random.random_range(COMPENSATED[0]..COMPENSATED[1]);
        let is_compensated = which == 0 && random.random::<f64>() < 0.3;
        let compensated = if is_compensated { takes_off } else { 0.0 };
        let grown_k = kind.node().map(|node| {
            let (face, skipped) = warmth.with_past(node);
            let mean = Behind::draw(random, lag_s).mean(&face);
            let left = mean.iter().zip(&face).map(|(m, f)| m - compensated * f);
            let left: Vec<f64> = left.skip(skipped).collect();
            left.iter().map(|degc| degc - left[0]).collect()
        });
        Self {
            kind,
            begins,
            grown_k: grown_k.unwrap_or_default(),
            wear: None,
            compensated,
        }
    }

    /// How many of [`Effect::other`] there are.
    pub const OTHERS: usize = 6;

    /// Readings of size 1 on the circles of a shift, then on its touches, µm.
    pub fn readings_um(&self, table: &Timetable) -> Vec<f64> {
        let circles = table.turns().flat_map(|turn| self.on_circle_um(turn));
        let touches = table.touches().map(|touch| self.on_touch_um(table, touch));
        circles.chain(touches).collect()
    }

    fn on_circle_um(&self, turn: &Turn) -> Vec<f64> {
        let middle_s = 0.5 * (turn.span_s[0] + turn.span_s[1]);
        let share = self.begins.share(middle_s);
        let (one, size) = match &self.kind {
            Kind::Drive(motion) => (self.worn_um(motion, turn), share),
            Kind::Screw(axis, _) => {
                let scale = Motion::Scale(*axis).radial_um(&turn.circle);
                (scale, at(&self.grown_k, middle_s))
            }
            _ => return vec![0.0; turn.circle.angles.len()],
        };
        one.iter().map(|value| size * value).collect()
    }

    /// What a motion makes of a circle, with the wear of its nut.
    fn worn_um(&self, motion: &Motion, turn: &Turn) -> Vec<f64> {
        let mut one = motion.radial_um(&turn.circle);
        let (Some(wear), Motion::Backlash(axis, ..)) = (self.wear, motion) else {
            return one;
        };
        let Circle {
            axes, radius_mm, ..
        } = turn.circle;
        for (value, angle) in one.iter_mut().zip(&turn.circle.angles) {
            let along = if axes[0] == *axis {
                angle.cos()
            } else {
                angle.sin()
            };
            *value *= wear.at(CENTRE_MM[*axis] + radius_mm * along);
        }
        one
    }

    /// How much further along its axis the tip is, µm.
    fn on_touch_um(&self, table: &Timetable, touch: &Touched) -> f64 {
        let block = &table.blocks[touch.block];
        let share = self.begins.share(touch.at_s);
        let grown_k = at(&self.grown_k, touch.at_s);
        let of = |axis: &usize| f64::from(u8::from(*axis == touch.axis));
        match &self.kind {
            // The tip stays behind by half of the play.
            Kind::Drive(Motion::Backlash(axis, ..)) => {
                let width = self
                    .wear
                    .map_or(1.0, |wear| wear.at(block.corner_mm[*axis]));
                -0.5 * width * share * of(axis) * block.senses[touch.axis]
            }
            Kind::Drive(Motion::Squareness([first, second])) => {
                1e-3 * share * of(first) * block.corner_mm[*second]
            }
            Kind::Drive(_) => 0.0,
            Kind::Spindle => -grown_k * of(&2),
            Kind::Column(along_z) => grown_k * (of(&1) + along_z * of(&2)),
            Kind::Screw(axis, fixed_mm) => {
                1e-3 * grown_k * of(axis) * (block.corner_mm[touch.axis] - fixed_mm)
            }
            Kind::Air(axis) => grown_k * of(axis),
            Kind::Reference(axis) => share * of(axis),
            Kind::Slip(own, axis) => share * of(axis) * f64::from(u8::from(*own == touch.block)),
            Kind::Creep(own, axis, creeps_s) => {
                let since_s = self
                    .begins
                    .instant_s()
                    .map_or(0.0, |from| touch.at_s - from);
                let crept = 1.0 - (-since_s.max(0.0) / creeps_s).exp();
                crept * of(axis) * f64::from(u8::from(*own == touch.block))
            }
        }
    }

    /// When it began, and between which tests that show it.
    pub fn change(&self, table: &Timetable) -> Option<Change> {
        let at_s = self.begins.instant_s()?;
        let shows = |entry: &&Entry| match entry {
            Entry::Turn(turn) => match &self.kind {
                Kind::Drive(motion) => {
                    let one = motion.radial_um(&turn.circle);
                    one.iter().any(|value| value.abs() > 1e-9)
                }
                _ => false,
            },
            Entry::Cycle(_) => match &self.kind {
                Kind::Drive(motion) => matches!(motion, Motion::Backlash(..)),
                _ => true,
            },
            Entry::Production(..) => false,
        };
        let begins = || table.entries.iter().filter(shows).map(|it| it.span_s()[0]);
        let before_s = begins().rfind(|begin_s| *begin_s < at_s);
        let after_s = begins().find(|begin_s| *begin_s >= at_s);
        Some(Change {
            at_s,
            between_s: [before_s.unwrap_or(0.0), after_s?],
        })
    }

    /// Names of the catalogue that are true of it; none where the catalogue has none.
    pub fn names(&self) -> Vec<Name> {
        let shift = |node: Node| name("thermal_shift", id_at(node));
        match &self.kind {
            Kind::Drive(motion) => vec![motion.name()],
            Kind::Spindle => vec![name("spindle_growth", ""), shift(Node::Front)],
            Kind::Column(_) => vec![name("column_bend", ""), shift(Node::Column)],
            Kind::Screw(axis, _) => vec![name("screw_elongation", LETTERS[*axis])],
            Kind::Air(axis) => vec![name("ambient_drift", LETTERS[*axis]), shift(Node::Room)],
            Kind::Reference(axis) => vec![name("homing_shift", LETTERS[*axis])],
            Kind::Slip(..) | Kind::Creep(..) => vec![],
        }
    }

    /// In the words of a shop.
    pub fn words(&self) -> String {
        let kind = match &self.kind {
            Kind::Drive(motion) => motion.words(),
            Kind::Spindle => "spindle",
            Kind::Column(_) => "column",
            Kind::Screw(..) => "screw that warms",
            Kind::Air(_) => "air",
            Kind::Reference(_) => "reference that shifts",
            Kind::Slip(..) => "clamp that slips",
            Kind::Creep(..) => "block that creeps",
        };
        let since = match (&self.kind, self.begins) {
            (Kind::Drive(_), Begins::At(_)) => " from an instant on",
            (Kind::Drive(_), Begins::Grows(..)) => " that grows",
            _ => "",
        };
        let form = match (self.wear, self.compensated > 0.0) {
            (Some(_), _) => " that varies",
            (_, true) => " that a control compensates",
            _ => "",
        };
        format!("{kind}{form}{since}")
    }

    /// Least and greatest size, and the unit.
    pub const fn sizes(&self) -> ([f64; 2], &'static str) {
        match &self.kind {
            Kind::Drive(motion) => motion.sizes(),
            Kind::Spindle | Kind::Column(_) | Kind::Air(_) => ([0.1, 12.0], "µm/K"),
            Kind::Screw(..) => ([0.5, 15.0], "µm/(m K)"),
            Kind::Reference(_) | Kind::Slip(..) | Kind::Creep(..) => ([0.3, 60.0], "µm"),
        }
    }

    /// Whether its size may be negative.
    pub const fn has_both_signs(&self) -> bool {
        match &self.kind {
            Kind::Drive(motion) => motion.has_both_signs(),
            Kind::Spindle | Kind::Screw(..) => false,
            _ => true,
        }
    }

    /// The catalogue's parameter that has its size, and the value for size 1 there; none of another form.
    pub fn parameter(&self) -> Option<(&'static str, f64)> {
        match &self.kind {
            Kind::Drive(Motion::Squareness(axes)) => {
                // The catalogue turns the second axis of the pair right-handed about the third direction.
                let sign = if axes.contains(&0) && axes.contains(&2) {
                    1.0
                } else {
                    -1.0
                };
                Some(("angle_urad", sign))
            }
            Kind::Drive(Motion::Scale(_)) => Some(("scale_um_per_m", 1.0)),
            Kind::Drive(Motion::Backlash(..)) if self.wear.is_none() => Some(("width_um", 1.0)),
            Kind::Drive(Motion::Slow(_)) => Some(("time_ms", 1.0)),
            Kind::Reference(_) => Some(("shift_um", 1.0)),
            _ => None,
        }
    }
}

impl Kind {
    const fn node(&self) -> Option<Node> {
        match self {
            Self::Spindle => Some(Node::Front),
            Self::Column(_) => Some(Node::Column),
            Self::Screw(..) => Some(Node::Nut),
            Self::Air(_) => Some(Node::Room),
            _ => None,
        }
    }
}

fn instant_s(random: &mut Pcg64Mcg) -> f64 {
    SHIFT_S * random.random_range(BEGINS[0]..BEGINS[1])
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn a_slipped_clamp_moves_one_face_of_one_block_from_its_instant_on() {
        let mut random = Pcg64Mcg::seed_from_u64(8);
        let table = Timetable::draw(&mut random);
        let slip = Effect {
            kind: Kind::Slip(0, 1),
            begins: Begins::At(7000.0),
            grown_k: vec![],
            wear: None,
            compensated: 0.0,
        };
        let readings = slip.readings_um(&table);
        let circles: usize = table.turns().map(|turn| turn.circle.angles.len()).sum();
        assert!(readings[..circles].iter().all(|value| value.abs() < 1e-12));
        for (touch, value) in table.touches().zip(&readings[circles..]) {
            let moves = touch.at_s >= 7000.0 && (touch.block, touch.axis) == (0, 1);
            assert!((value - f64::from(u8::from(moves))).abs() < 1e-12);
        }
        let change = slip.change(&table).unwrap();
        assert!(change.between_s[0] < 7000.0 && change.between_s[1] >= 7000.0);
        assert!(change.between_s[1] - change.between_s[0] <= table.cycle_s());
    }

    #[test]
    fn a_worn_nut_has_its_width_on_average_and_less_or_more_from_place_to_place() {
        let wear = Wear::draw(&mut Pcg64Mcg::seed_from_u64(6));
        let widths: Vec<f64> = (0..10_000).map(|k| wear.at(f64::from(k))).collect();
        let mean = widths.iter().sum::<f64>() / 1e4;
        let least = widths
            .iter()
            .fold(1.0_f64, |least, width| least.min(*width));
        assert!((mean - 1.0).abs() < 0.03 && (0.29..0.81).contains(&least));
    }

    #[test]
    fn play_from_an_instant_on_shows_on_touches_and_on_later_circles() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let table = Timetable::draw(&mut random);
        let axis = table.tables[0].circles[0].axes[0];
        let play = Effect {
            kind: Kind::Drive(Motion::lost_motion(&mut random, axis)),
            begins: Begins::At(9000.0),
            grown_k: vec![],
            wear: None,
            compensated: 0.0,
        };
        for turn in table.turns() {
            let one = play.on_circle_um(turn);
            let is_there = turn.span_s[0] > 9000.0 && turn.circle.axes.contains(&axis);
            assert_eq!(one.iter().any(|value| value.abs() > 0.1), is_there);
        }
        let of_axis = |touch: &&Touched| touch.axis == axis && touch.at_s > 9000.0;
        let touch = table.touches().find(of_axis).unwrap();
        assert!((play.on_touch_um(&table, touch).abs() - 0.5).abs() < 1e-12);
    }
}
