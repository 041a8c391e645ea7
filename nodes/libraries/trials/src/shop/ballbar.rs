//! Arm s2: circles of a ballbar, in both senses, at one or two feeds, in one to three planes.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use rand::Rng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

use super::dice::{how_many, log_uniform, sign};
use super::layout::START_S;
use super::machine_motion::{Circle, Motion};
use super::metric::{Floor, Metric};
use super::truth::{Name, ShopEffect, ShopTruth, name};
use super::{ShopSession, Table};

/// D of hidden effects.
const D_OF_BALLBAR: [f64; 2] = [4.0, 300.0];
/// Letters of the axes.
pub(super) const LETTERS: [&str; 3] = ["X", "Y", "Z"];
/// Planes: name, axes, and the pair as the catalogue names it.
pub(super) const PLANES: [(&str, [usize; 2], &str); 3] = [
    ("XY", [0, 1], "XY"),
    ("YZ", [1, 2], "YZ"),
    ("ZX", [2, 0], "XZ"),
];
/// Time between two tables: a mounting, s.
const MOUNTING_S: u64 = 1200;
/// D that other hidden effects must leave of one that can be told from them.
pub(super) const MIN_D_APART: f64 = 5.0;
/// Readings that a period needs.
const MIN_READINGS_OF_A_PERIOD: f64 = 5.0;

/// Circles of one plane and feed: a table.
#[derive(Clone, Debug)]
pub(super) struct Mounted {
    /// Which of [`PLANES`].
    pub plane: usize,
    /// Its circles, in their order.
    pub circles: Vec<Circle>,
}

/// What is hidden, with its readings at size 1 of all tables together.
struct Hidden {
    motion: Motion,
    size: f64,
    one: Vec<f64>,
}

/// Draws a session.
pub fn draw(random: &mut Pcg64Mcg) -> ShopSession {
    let mut planes: Vec<usize> = vec![0, 1, 2];
    planes.shuffle(random);
    planes.truncate(random.random_range(1..=3));
    planes.sort_unstable();
    let lead_mm = [5.0, 8.0, 10.0, 12.0, 16.0, 20.0][random.random_range(0..6)];
    let tables = tables(random, &planes);
    let memory = random.random_range(0.5..0.95);
    let floor = Floor::draw(random, [0.1, 0.6], [0.05, 0.4]).with_memory(memory);
    let courses = courses(&tables);
    let metric = Metric::of(&floor, &courses);
    let set_up = set_up(&tables, metric.len());
    let count = how_many(random);
    let wanted = motions(random, &tables, lead_mm, count);
    let of = |motion| hide(random, motion, &tables, &metric, &set_up);
    let hidden: Vec<Hidden> = wanted.into_iter().map(of).collect();
    let effects = (0..hidden.len()).map(|own| effect(&tables, &metric, &set_up, &hidden, own));
    let effects = effects.collect();
    let mut noise = courses
        .iter()
        .flat_map(|course| floor.run(random, course))
        .collect::<Vec<f64>>();
    for own in &hidden {
        noise
            .iter_mut()
            .zip(&own.one)
            .for_each(|(sum, one)| *sum += own.size * one);
    }
    let feeds = tables.len() / planes.len();
    ShopSession {
        shift: None,
        machine: super::positioning::machine([lead_mm; 3]),
        truth: ShopTruth {
            session: format!(
                "ballbar, {} and {}",
                counted(feeds, "feed"),
                counted(planes.len(), "plane")
            ),
            layout: counted(tables.len(), "table"),
            repeats: tables.first().map_or(0, |table| table.circles.len() / 2),
            places: planes.len(),
            effects,
            white_um: floor.white_um,
            between_runs_um: floor.between_runs_um,
            memory: floor.memory,
            shift: None,
        },
        tables: written(&tables, &noise),
    }
}

/// The course of every circle's readings.
fn courses(tables: &[Mounted]) -> Vec<Vec<f64>> {
    let turned = |angle: &f64| angle.rem_euclid(TAU) / TAU;
    circles(tables)
        .map(|circle| circle.angles.iter().map(turned).collect())
        .collect()
}

/// An effect at a size whose D is drawn.
fn hide(
    random: &mut Pcg64Mcg,
    motion: Motion,
    tables: &[Mounted],
    metric: &Metric,
    set_up: &[Vec<f64>],
) -> Hidden {
    let one: Vec<f64> = circles(tables)
        .flat_map(|circle| motion.radial_um(circle))
        .collect();
    let d_of_one = metric.d(&one, set_up);
    let ([low, high], _) = motion.sizes();
    let size = (log_uniform(random, D_OF_BALLBAR) / d_of_one.max(1e-9)).clamp(low, high);
    let size = if motion.has_both_signs() {
        sign(random) * size
    } else {
        size
    };
    Hidden { motion, size, one }
}

/// So many of something, in words.
pub(super) fn counted(n: usize, what: &str) -> String {
    let plural = if n == 1 { "" } else { "s" };
    format!("{n} {what}{plural}")
}

fn circles(tables: &[Mounted]) -> impl Iterator<Item = &Circle> {
    tables.iter().flat_map(|table| &table.circles)
}

fn tables(random: &mut Pcg64Mcg, planes: &[usize]) -> Vec<Mounted> {
    let radius_mm = [50.0, 100.0, 150.0][random.random_range(0..3)];
    let slow_mm_s = log_uniform(random, [15.0, 40.0]).round();
    let mut feeds = vec![slow_mm_s];
    if random.random() {
        feeds.push(
            (slow_mm_s * random.random_range(1.5..2.5))
                .round()
                .min(80.0),
        );
    }
    let most = if planes.len() * feeds.len() > 2 { 1 } else { 3 };
    let repeats: usize = random.random_range(1..=most);
    let rows = [180, 240, 360][random.random_range(0..3)];
    let mut tables = vec![];
    for plane in planes {
        for feed_mm_s in &feeds {
            let circle = |k: usize| {
                let is_ccw = k.is_multiple_of(2);
                let turned = |row: usize| {
                    let row = if is_ccw { row } else { rows - row };
                    TAU * row as f64 / rows as f64
                };
                Circle {
                    axes: PLANES[*plane].1,
                    radius_mm,
                    feed_mm_s: *feed_mm_s,
                    is_ccw,
                    angles: (0..=rows).map(turned).collect(),
                }
            };
            tables.push(Mounted {
                plane: *plane,
                circles: (0..2 * repeats).map(circle).collect(),
            });
        }
    }
    tables
}

/// Centre and length of the bar of every table.
fn set_up(tables: &[Mounted], len: usize) -> Vec<Vec<f64>> {
    let mut columns = vec![];
    let mut from = 0;
    for table in tables {
        let angles: Vec<f64> = { table.circles.iter() }
            .flat_map(|circle| circle.angles.clone())
            .collect();
        for of in [|_: f64| 1.0, f64::cos, f64::sin] {
            let mut column = vec![0.0; len];
            let own = column[from..].iter_mut().zip(&angles);
            own.for_each(|(value, angle)| *value = of(*angle));
            columns.push(column);
        }
        from += angles.len();
    }
    columns
}

/// Different effects of axes and pairs that the circles show.
pub(super) fn motions(
    random: &mut Pcg64Mcg,
    tables: &[Mounted],
    lead_mm: f64,
    count: usize,
) -> Vec<Motion> {
    let mut axes: Vec<usize> = circles(tables).flat_map(|circle| circle.axes).collect();
    axes.sort_unstable();
    axes.dedup();
    let mut planes: Vec<usize> = tables.iter().map(|table| table.plane).collect();
    planes.dedup();
    let is_close = |circle: &Circle| {
        let step_mm = TAU * circle.radius_mm / circle.angles.len() as f64;
        step_mm * MIN_READINGS_OF_A_PERIOD < lead_mm
    };
    let mut kinds: Vec<u8> = vec![0, 1, 2, 2, 3, 4, 5];
    kinds.shuffle(random);
    let mut found: Vec<Motion> = vec![];
    for kind in kinds {
        let axis = axes[random.random_range(0..axes.len())];
        let plane = planes[random.random_range(0..planes.len())];
        let motion = match kind {
            0 => Motion::Squareness(PLANES[plane].1),
            1 => Motion::Scale(axis),
            2 => Motion::lost_motion(random, axis),
            3 => Motion::reversal(random, axis),
            4 => Motion::Slow(axis),
            _ => Motion::Cyclic(axis, [lead_mm, random.random_range(0.0..TAU)]),
        };
        let is_seen = !matches!(motion, Motion::Cyclic(..)) || circles(tables).all(is_close);
        let is_new = |other: &Motion| other.name() != motion.name();
        if found.len() < count && is_seen && found.iter().all(is_new) {
            found.push(motion);
        }
    }
    found
}

impl Motion {
    /// Its name in the catalogue.
    pub(super) fn name(&self) -> Name {
        match self {
            Self::Squareness(axes) => {
                let plane = PLANES.iter().find(|(_, own, _)| own == axes);
                name("squareness", plane.map_or("", |(.., pair)| pair))
            }
            Self::Scale(axis) => name("scale_error", LETTERS[*axis]),
            Self::Backlash(axis, ..) => name("backlash", LETTERS[*axis]),
            Self::Reversal(axis, _) => name("reversal_spike", LETTERS[*axis]),
            Self::Slow(axis) => name("servo_lag", LETTERS[*axis]),
            Self::Cyclic(axis, _) => name("cyclic_error", LETTERS[*axis]),
        }
    }

    /// In the words of a shop.
    pub(super) const fn words(&self) -> &'static str {
        match self {
            Self::Squareness(_) => "squareness",
            Self::Scale(_) => "scale of an axis",
            Self::Backlash(..) => "lost motion",
            Self::Reversal(..) => "reversal spike",
            Self::Slow(_) => "servo mismatch",
            Self::Cyclic(..) => "cyclic error",
        }
    }

    /// Least and greatest size, and the unit.
    pub(super) const fn sizes(&self) -> ([f64; 2], &'static str) {
        match self {
            Self::Squareness(_) => ([2.0, 300.0], "µrad"),
            Self::Scale(_) => ([2.0, 300.0], "µm/m"),
            Self::Backlash(..) => ([0.3, 40.0], "µm"),
            Self::Reversal(..) => ([0.5, 60.0], "µm"),
            Self::Slow(_) => ([0.01, 3.0], "ms"),
            Self::Cyclic(..) => ([0.1, 10.0], "µm"),
        }
    }

    /// Whether its size may be negative.
    pub(super) const fn has_both_signs(&self) -> bool {
        matches!(self, Self::Squareness(_) | Self::Scale(_) | Self::Slow(_))
    }

    /// The axis whose readings a sole plane does not tell from those of another.
    const fn mismatched(&self) -> Option<usize> {
        match self {
            Self::Scale(axis) | Self::Slow(axis) => Some(*axis),
            _ => None,
        }
    }
}

/// The other axis of the only plane that shows an axis.
fn sole_partner(tables: &[Mounted], axis: usize) -> Option<usize> {
    let mut shown: Vec<[usize; 2]> = tables.iter().map(|table| PLANES[table.plane].1).collect();
    shown.dedup();
    let own: Vec<[usize; 2]> = shown
        .into_iter()
        .filter(|axes| axes.contains(&axis))
        .collect();
    match own[..] {
        [axes] => axes.into_iter().find(|other| *other != axis),
        _ => None,
    }
}

/// What makes the same readings as a motion on these circles.
pub(super) fn look_alikes(tables: &[Mounted], motion: &Motion) -> Vec<Name> {
    let (id, axis) = motion.name();
    let mut same = vec![];
    let feeds_of = |plane: usize| tables.iter().filter(move |table| table.plane == plane);
    if id == "backlash"
        && tables
            .iter()
            .all(|table| feeds_of(table.plane).count() == 1)
    {
        same.push(name("feed_lost_motion", &axis));
    }
    if let Some(axis) = motion.mismatched() {
        // Only the difference of two axes shows where a sole plane has either.
        if let Some(other) =
            sole_partner(tables, axis).filter(|other| sole_partner(tables, *other) == Some(axis))
        {
            same.push(name(&id, LETTERS[other]));
        }
    }
    same
}

fn effect(
    tables: &[Mounted],
    metric: &Metric,
    set_up: &[Vec<f64>],
    hidden: &[Hidden],
    own: usize,
) -> ShopEffect {
    let Hidden { motion, size, one } = &hidden[own];
    let readings: Vec<f64> = one.iter().map(|value| size * value).collect();
    let others = || { hidden.iter().enumerate() }.filter(|(k, _)| *k != own);
    let mut taken_out = set_up.to_vec();
    taken_out.extend(others().map(|(_, other)| other.one.clone()));
    let d_alone = metric.d(&readings, &taken_out);
    let mut same = look_alikes(tables, motion);
    if d_alone < MIN_D_APART {
        same.extend(others().map(|(_, other)| other.motion.name()));
    }
    ShopEffect {
        what: motion.words().to_owned(),
        names: vec![motion.name()],
        besides: vec![],
        same_readings: same,
        size: *size,
        unit: motion.sizes().1.to_owned(),
        d: metric.d(&readings, set_up),
        d_alone,
        follow: None,
        parameter: None,
        change: None,
    }
}

fn written(tables: &[Mounted], radial_um: &[f64]) -> Vec<Table> {
    let mut readings = radial_um.iter();
    let of = |(number, table): (usize, &Mounted)| {
        let mut text = "run,angle_deg,radial_um\n".to_owned();
        for (run, circle) in table.circles.iter().enumerate() {
            for (angle, radial_um) in circle.angles.iter().zip(&mut readings) {
                let _ = writeln!(text, "{},{:.3},{radial_um:.3}", run + 1, angle.to_degrees());
            }
        }
        let first = &table.circles[0];
        let start_s = START_S + MOUNTING_S * number as u64;
        let plane = PLANES[table.plane].0;
        let map = format!(
            "start_s: {start_s}\ntest:\n  circle: {{plane: {plane}, centre_mm: [0.0, 0.0, 190.0], radius_mm: {:.1}, \
             feed_mm_min: {:.1}, run: run, angle_deg: angle_deg, radial_um: radial_um}}\n",
            first.radius_mm,
            60.0 * first.feed_mm_s
        );
        Table {
            name: format!("ballbar_{}_{plane}", number + 1),
            text,
            map,
        }
    };
    tables.iter().enumerate().map(of).collect()
}
