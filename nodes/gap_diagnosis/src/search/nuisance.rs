//! What every set-up leaves open: zeros, the turn of the plate, centre and radius of a ballbar, features.
//!
//! # Model
//!
//! | channel | floats | once for each |
//! |---|---|---|
//! | grid u, v | offset of u, of v | zero of the plate |
//! | grid u and v | turn of the plate about its normal | set-up and plane |
//! | radial | centre and radius | run |
//! | length | offset | zero |
//! | touch of a sphere | centre in the workpiece frame and radius, at all poses of rotary axes | set-up and sphere |
//! | touch of a bore or boss | centre and radius | set-up and bore |
//! | touch of a plane | offset and two tilts | set-up and plane |
//! | other touches | offset | set-up, feature and approach |
//! | motor, scale, thermometer | offset | set-up |
//!
//! They are no errors of the machine, and always projected out: P = I - Q Q', Q = orth(W N).
//!
//! # Holds when
//! What the table says is all that a set-up leaves open.

use std::collections::BTreeMap;

use machine::Kinematics;
use machine::cycle::FeatureId;
use metrology::Axis;
use metrology::sample::{TestKind, TestPlane};
use nalgebra::{DMatrix, DVector};
use twin::simulate::plate_axes;
use twin::{Channel, Run, Session, Touch, Twin};

use crate::search::field::{self, Place};
use crate::search::rows::{Block, Rows, position};

/// What shares floats, and which float of it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    group: String,
    float: String,
}

/// The projector P.
#[derive(Clone, Debug)]
pub struct Nuisance {
    groups: Vec<Group>,
    /// Number of floats.
    pub count: usize,
}

#[derive(Clone, Debug)]
struct Group {
    blocks: Vec<std::ops::Range<usize>>,
    basis: DMatrix<f64>,
}

impl Nuisance {
    /// Floats of a stack and `more` columns that float beside them, each made white by `whiten`, orthonormal. All that share rows
    /// with one of `more` are one group.
    pub fn new(
        twin: &Twin<'_>,
        session: &Session,
        rows: &Rows,
        more: &[Vec<f64>],
        whiten: impl Fn(&mut [f64]),
    ) -> Self {
        let mut columns = BTreeMap::<Key, Vec<f64>>::new();
        for block in &rows.blocks {
            for (key, values) in floats(twin.kinematics(), session, block) {
                let column = columns.entry(key).or_insert_with(|| vec![0.0; rows.len]);
                column[block.range()].copy_from_slice(&values);
            }
        }
        let is_shared = |column: &[f64]| {
            let rows = |other: &Vec<f64>| {
                other
                    .iter()
                    .zip(column)
                    .any(|(a, b)| *a != 0.0 && *b != 0.0)
            };
            more.iter().any(rows)
        };
        let mut by_group = BTreeMap::<String, Vec<Vec<f64>>>::new();
        for (key, mut column) in columns {
            let group = if is_shared(&column) {
                String::new()
            } else {
                key.group
            };
            whiten(&mut column);
            by_group.entry(group).or_default().push(column);
        }
        for mut column in more.iter().cloned() {
            whiten(&mut column);
            by_group.entry(String::new()).or_default().push(column);
        }
        let groups: Vec<Group> = by_group
            .into_values()
            .map(|columns| Group::new(rows, &columns))
            .collect();
        let count = groups.iter().map(|group| group.basis.ncols()).sum();
        Self { groups, count }
    }

    /// Projects the floats out of a stack, in place.
    pub fn project(&self, stack: &mut [f64]) {
        for group in &self.groups {
            let mut part = DVector::from_iterator(
                group.basis.nrows(),
                group
                    .blocks
                    .iter()
                    .flat_map(|r| stack[r.clone()].iter().copied()),
            );
            let along = group.basis.tr_mul(&part);
            part.gemv(-1.0, &group.basis, &along, 1.0);
            let mut values = part.iter();
            for place in group.blocks.iter().cloned().flatten() {
                stack[place] = *values.next().expect("as many as were gathered");
            }
        }
    }
}

impl Group {
    fn new(rows: &Rows, columns: &[Vec<f64>]) -> Self {
        let blocks: Vec<_> = rows
            .blocks
            .iter()
            .map(Block::range)
            .filter(|range| {
                columns
                    .iter()
                    .any(|column| column[range.clone()].iter().any(|v| *v != 0.0))
            })
            .collect();
        let count = blocks.iter().map(ExactSizeIterator::len).sum();
        let gathered = columns.iter().map(|column| {
            let rows = blocks
                .iter()
                .flat_map(|r| column[r.clone()].iter().copied());
            DVector::from_iterator(count, rows)
        });
        let basis = orthonormal(count, gathered);
        Self { blocks, basis }
    }
}

/// Orthonormal basis of some columns, those that add nothing left out (Gram-Schmidt, twice).
pub fn orthonormal(rows: usize, columns: impl Iterator<Item = DVector<f64>>) -> DMatrix<f64> {
    let mut basis = Vec::<DVector<f64>>::new();
    for mut column in columns {
        let size = column.norm();
        for _ in 0..2 {
            for other in &basis {
                let along = other.dot(&column);
                column.axpy(-along, other, 1.0);
            }
        }
        let left = column.norm();
        if left > 1e-6 * size && left > 0.0 {
            basis.push(column / left);
        }
    }
    if basis.is_empty() {
        return DMatrix::zeros(rows, 0);
    }
    DMatrix::from_columns(&basis)
}

/// Floats of one block with its values of each.
fn floats(kinematics: &Kinematics, session: &Session, block: &Block) -> Vec<(Key, Vec<f64>)> {
    let run = &session.runs[block.run];
    let segment = &run.segment;
    let n = block.rows.len();
    let key = |group: String, float: String| Key { group, float };
    match &block.channel {
        Channel::GridU | Channel::GridV => {
            let group = format!("grid {}", segment.setup_id);
            let offset = format!("{} {}", block.channel, segment.zero_id);
            let turn = format!("turn {}", plane_name(segment.plane));
            vec![
                (key(group.clone(), offset), vec![1.0; n]),
                (key(group, turn), turn_of_plate(session, block)),
            ]
        }
        Channel::Radial => {
            let group = format!("radial {}", block.run);
            let angle = |place: &Place| match place {
                Place::Circle(angle) => *angle,
                Place::Line(_) | Place::None => 0.0,
            };
            let angles: Vec<f64> = field::places(run, block).iter().map(angle).collect();
            vec![
                (key(group.clone(), "radius".into()), vec![1.0; n]),
                (
                    key(group.clone(), "cos".into()),
                    angles.iter().map(|a| a.cos()).collect(),
                ),
                (
                    key(group, "sin".into()),
                    angles.iter().map(|a| a.sin()).collect(),
                ),
            ]
        }
        Channel::Length(_) => {
            let group = format!("{} {} {}", block.channel, segment.setup_id, segment.zero_id);
            vec![(key(group, String::new()), vec![1.0; n])]
        }
        Channel::Touch => touch_floats(kinematics, session, block),
        // What one thermometer shows beyond another at its place is nothing by itself, and its offset an effect.
        Channel::Thermometer(_) => vec![],
        Channel::Motor(_) | Channel::Scale(_) => {
            let group = format!("{} {}", block.channel, segment.setup_id);
            vec![(key(group, String::new()), vec![1.0; n])]
        }
    }
}

fn touch_floats(kinematics: &Kinematics, session: &Session, block: &Block) -> Vec<(Key, Vec<f64>)> {
    let run = &session.runs[block.run];
    let mut all = BTreeMap::<Key, Vec<f64>>::new();
    for (row, place) in block.rows.iter().zip(0..) {
        let Some(touch) = row.touch.and_then(|touch| run.touches.get(touch)) else {
            continue;
        };
        let (owner, floats) = surface_floats(kinematics, run, touch);
        for (float, value) in floats {
            // One group for the whole set-up: whitening mixes the touches of a run, so that they float together.
            let key = Key {
                group: format!("touch {}", run.segment.setup_id),
                float: format!("{owner} {float}"),
            };
            all.entry(key)
                .or_insert_with(|| vec![0.0; block.rows.len()])[place] = value;
        }
    }
    all.into_iter().collect()
}

/// What the place of a touched surface leaves open, by name, and what shares it.
fn surface_floats(
    kinematics: &Kinematics,
    run: &Run,
    touch: &Touch,
) -> (String, Vec<(&'static str, f64)>) {
    let a = touch.approach;
    let owner = match FeatureId::parse(&touch.feature_id) {
        Some(FeatureId::Point { artefact, .. }) => artefact.to_owned(),
        _ => touch.feature_id.clone(),
    };
    let across = |axis: Axis| touch.position[axis] * (1.0 - a[axis.index()].abs());
    match run.segment.kind {
        TestKind::Sphere | TestKind::Rotary | TestKind::RotaryVerification => {
            let n = kinematics.direction_in_workpiece(&touch.position, &a);
            let floats = [("radius", 1.0), ("x", n.x), ("y", n.y), ("z", n.z)];
            (owner, floats.to_vec())
        }
        TestKind::Bore => (owner, vec![("radius", 1.0), ("x", a.x), ("y", a.y)]),
        TestKind::Plane => {
            let tilts = [
                ("tilt x", Axis::X),
                ("tilt y", Axis::Y),
                ("tilt z", Axis::Z),
            ];
            let tilts = tilts.map(|(name, axis)| (name, across(axis)));
            (owner, [[("offset", 1.0)].as_slice(), &tilts].concat())
        }
        _ => {
            let a = a.map(|c| (c * 100.0).round() + 0.0);
            let whose = format!("{} {} {} {}", touch.feature_id, a.x, a.y, a.z);
            (whose, vec![("", 1.0)])
        }
    }
}

/// What a turn of the plate by one radian reads: -v in u, +u in v.
fn turn_of_plate(session: &Session, block: &Block) -> Vec<f64> {
    let run = &session.runs[block.run];
    let Some([u, v]) = plate_axes(run.segment.plane) else {
        return vec![0.0; block.rows.len()];
    };
    let of = |row| match block.channel {
        Channel::GridU => -position(run, row, v),
        _ => position(run, row, u),
    };
    block.rows.iter().map(of).collect()
}

/// Name of a plane.
pub fn plane_name(plane: TestPlane) -> &'static str {
    match plane {
        TestPlane::Xy => "XY",
        TestPlane::Yz => "YZ",
        TestPlane::Zx => "ZX",
        TestPlane::None => "",
    }
}
