//! The smooth deviation in which one run differs from its repeat.
//!
//! # Model
//!
//! A random field over the angle of a circle (over the position on a line, as angle from 0 to pi), an
//! offset and a drift along the run:
//!
//! ```text
//!   f(a, t) = sum_k w_k (c_k cos ka + s_k sin ka) + o + d t               (1)
//!   var c_k = var s_k = p2 exp(-(k l)^2 / 2) / sum_j exp(-(j l)^2 / 2)    (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | p | `place_mm` | mm |
//! | l | `length_rad` | rad |
//! | o, d | `offset_mm`, `drift_mm`, standard deviations; t from -1 to 1 | mm |
//!
//! # Holds when
//! Runs deviate independently of one another. Twelve harmonics: shorter than 30 degrees is left to the
//! autoregression.
//!
//! # References
//! \[1\] ISO 230-4:2022 (repeats of a circular test differ). \[2\] C. E. Rasmussen, C. K. I. Williams,
//! Gaussian Processes for Machine Learning, MIT Press 2006, 4.2 (squared exponential).

use metrology::Axis;
use nalgebra::DMatrix;
use twin::simulate::plate_axes;
use twin::{Channel, Run};

use crate::search::rows::{Block, Row, count, position, time_s};

/// Harmonics of the field.
pub const HARMONICS: usize = 12;

/// One column of (1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Cosine or sine of this multiple of the angle.
    Place(usize),
    /// Constant.
    Offset,
    /// Along the run.
    Drift,
}

/// Standard deviations of the field of one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Smooth {
    /// Of the field over place.
    pub place_mm: f64,
    /// Its length.
    pub length_rad: f64,
    /// Of the offset.
    pub offset_mm: f64,
    /// Of the drift's end.
    pub drift_mm: f64,
}

impl Smooth {
    /// Standard deviation of the coefficient of a mode.
    pub fn of(&self, mode: Mode) -> f64 {
        match mode {
            Mode::Offset => self.offset_mm,
            Mode::Drift => self.drift_mm,
            Mode::Place(k) => {
                let weight = |k: usize| (-0.5 * (count(k) * self.length_rad).powi(2)).exp();
                let sum: f64 = (1..=HARMONICS).map(weight).sum();
                self.place_mm * (weight(k) / sum.max(f64::MIN_POSITIVE)).sqrt()
            }
        }
    }

    /// Standard deviation of the field at one place, offset and drift included.
    pub fn total_mm(&self) -> f64 {
        (self.place_mm.powi(2) + self.offset_mm.powi(2) + self.drift_mm.powi(2) / 3.0).sqrt()
    }
}

/// Where a row lies on a closed circle or on a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Angle about the centre, rad.
    Circle(f64),
    /// Share of the travel as an angle from 0 to pi.
    Line(f64),
    /// It does not move, or is a touch.
    None,
}

/// Places of the rows of a block.
pub fn places(run: &Run, block: &Block) -> Vec<Place> {
    if matches!(block.channel, Channel::Touch | Channel::Thermometer(_)) {
        return vec![Place::None; block.rows.len()];
    }
    if let (Some(axes), true) = (plate_axes(run.segment.plane), run.segment.radius_mm > 0.0) {
        let at =
            |row: &Row, axis: Axis| position(run, row, axis) - run.segment.centre_mm[axis.index()];
        let angle = |row| Place::Circle(at(row, axes[1]).atan2(at(row, axes[0])));
        return block.rows.iter().map(angle).collect();
    }
    line_places(run, block)
}

/// The axis that moves most in a block, with its least and greatest position.
pub fn leading_axis(run: &Run, block: &Block) -> Option<(Axis, f64, f64)> {
    run.motion
        .axes
        .iter()
        .map(|axis| {
            let all = || block.rows.iter().map(|row| position(run, row, axis));
            (
                axis,
                all().fold(f64::INFINITY, f64::min),
                all().fold(f64::NEG_INFINITY, f64::max),
            )
        })
        .filter(|(_, low, high)| high - low > 1e-3)
        .max_by(|a, b| (a.2 - a.1).total_cmp(&(b.2 - b.1)))
}

fn line_places(run: &Run, block: &Block) -> Vec<Place> {
    let Some((axis, low, high)) = leading_axis(run, block) else {
        return vec![Place::None; block.rows.len()];
    };
    let share = |row: &Row| (position(run, row, axis) - low) / (high - low);
    let place = |row| Place::Line(std::f64::consts::PI * share(row));
    block.rows.iter().map(place).collect()
}

/// Columns of (1) for a block, each with unit mean square where it goes round.
pub fn modes(run: &Run, block: &Block) -> (Vec<Mode>, DMatrix<f64>) {
    let n = block.rows.len();
    let places = places(run, block);
    let mut kinds = vec![Mode::Offset];
    let mut values = vec![1.0; n];
    let of_touch = block.channel == Channel::Touch;
    if n > 2 && !of_touch {
        kinds.push(Mode::Drift);
        values.extend(run_time(run, block));
    }
    let harmonics = HARMONICS.min(n / 8);
    for k in 1..=harmonics {
        match places.first() {
            Some(Place::Circle(_)) => {
                kinds.extend([Mode::Place(k); 2]);
                let wave = |turn: f64| move |p: &Place| angle_of(p).mul_add(count(k), turn).cos();
                values.extend(places.iter().map(wave(0.0)));
                values.extend(places.iter().map(wave(-std::f64::consts::FRAC_PI_2)));
            }
            Some(Place::Line(_)) => {
                kinds.push(Mode::Place(k));
                let wave = |p: &Place| std::f64::consts::SQRT_2 * (angle_of(p) * count(k)).cos();
                values.extend(places.iter().map(wave));
            }
            Some(Place::None) | None => {}
        }
    }
    let columns = kinds.len();
    (kinds, DMatrix::from_vec(n, columns, values))
}

fn angle_of(place: &Place) -> f64 {
    match place {
        Place::Circle(angle) | Place::Line(angle) => *angle,
        Place::None => 0.0,
    }
}

/// Time along the run, from -1 to 1.
fn run_time(run: &Run, block: &Block) -> Vec<f64> {
    let times: Vec<f64> = block.rows.iter().map(|row| time_s(run, row)).collect();
    let (first, last) = (times[0], times[times.len() - 1]);
    let half = (0.5 * (last - first)).max(f64::MIN_POSITIVE);
    times.iter().map(|t| (t - first) / half - 1.0).collect()
}
