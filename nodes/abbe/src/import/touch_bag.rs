//! Touches of a list as messages of a bag.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use metrology::number::number;
use metrology::sample::{
    Correction, FeatureKind, ProbedFeature, ProbedPoint, Rejection, TestKind, TestSegment,
};
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use nalgebra::{Matrix3, Vector3};

use super::map::{Map, Test};
use super::runs::Runs;
use super::stated;
use super::table::Row;
use super::touch_shapes::{self, Shape};
use super::touches::{TIME, feature, name, place};
use super::writer::Writer;

/// Time from touch to touch where nobody stated it, s.
const TOUCH_SPACING_S: f64 = 1.0;
/// A list whose shapes all have smaller diameters may be in inches, mm.
const SMALL_MM: f64 = 3.0;

/// Asks whether a list without a unit is in inches, where its shapes are too small for mm.
pub fn doubt(map: &Map, runs: &Runs) -> Option<String> {
    let Test::Touches { x_mm, .. } = &map.test else {
        return None;
    };
    if map.units.contains_key(x_mm) || stated::of(x_mm).unit().is_some() {
        return None;
    }
    let groups = runs.runs.iter().filter_map(|rows| groups(rows, &[]).ok());
    let diameters = groups.flatten().filter_map(|group| match group.shape {
        Shape::Place(_) => None,
        Shape::Sphere(round) | Shape::Ring(round, _) => Some(2.0 * round.radius_mm),
    });
    let greatest_mm = diameters.fold(0.0, f64::max);
    let is_small = greatest_mm > 0.0 && greatest_mm < SMALL_MM;
    is_small.then(|| {
        format!(
            "warning, column \"{x_mm}\": no diameter above {} mm: are they inches? Then state units: {{X: inch, Y: inch, Z: inch}} with the \
             names of the columns in a map",
            number((greatest_mm * 1e3).round() / 1e3)
        )
    })
}

/// Writes every run of a list; gives their number.
///
/// # Errors
/// When times go back, or the bag cannot be written.
pub fn write(runs: &Runs, features: &[String], writer: &mut Writer) -> Result<u32> {
    let mut n = 0;
    let mut sequence = 0;
    let begin_s = runs
        .runs
        .iter()
        .flatten()
        .find_map(|row| row.cells.get(TIME).copied());
    for rows in &runs.runs {
        n += 1;
        let groups = groups(rows, features)?;
        let test = segment(n, &groups);
        let mut counted = vec![0_u32; groups.len()];
        let mut has_begun = false;
        for row in rows {
            go_on(row, begin_s, writer)?;
            if !std::mem::replace(&mut has_begun, true) {
                writer.segment(&test, true)?;
            }
            let of = groups.iter().zip(&mut counted);
            for (group, count) in of.filter(|(group, _)| group.feature == feature(row)) {
                *count += 1;
                sequence += 1;
                // Touches of one place have one name, by which an evaluation gathers them.
                let id = match &group.shape {
                    Shape::Place(_) => group.name.clone(),
                    _ => format!("{}.{count}", group.name),
                };
                writer.touch(&point(row, &group.shape, (id, sequence)))?;
            }
        }
        for shape in groups.iter().filter_map(|group| fitted(group, n)) {
            writer.feature(&shape)?;
        }
        writer.wait(TOUCH_SPACING_S / 1e3);
        writer.segment(&test, false)?;
    }
    Ok(n)
}

/// Touches of one feature in one run, with what they are of.
struct Group {
    feature: usize,
    name: String,
    points: Vec<Vector3<f64>>,
    shape: Shape,
}

fn groups(rows: &[Row], features: &[String]) -> Result<Vec<Group>> {
    let mut points: BTreeMap<usize, Vec<Vector3<f64>>> = BTreeMap::new();
    for row in rows {
        points.entry(feature(row)).or_default().push(place(row));
    }
    let group = |(feature, points): (usize, Vec<Vector3<f64>>)| {
        let shape = touch_shapes::of(&points).map_err(anyhow::Error::msg)?;
        Ok(Group {
            feature,
            name: name(feature, &shape, features),
            points,
            shape,
        })
    };
    points.into_iter().map(group).collect()
}

/// Goes to the time of a touch.
fn go_on(row: &Row, begin_s: Option<f64>, writer: &mut Writer) -> Result<()> {
    match (row.cells.get(TIME), begin_s) {
        (Some(time_s), Some(begin_s)) => writer
            .begin_row(time_s - begin_s)
            .with_context(|| format!("line {}: time {time_s} s", row.line)),
        _ => {
            writer.wait(TOUCH_SPACING_S);
            Ok(())
        }
    }
}

fn segment(run: u32, groups: &[Group]) -> TestSegment {
    let all = |is: fn(&Shape) -> bool| groups.iter().all(|group| is(&group.shape));
    let kind = if all(|shape| matches!(shape, Shape::Sphere(_))) {
        TestKind::Sphere
    } else if all(|shape| matches!(shape, Shape::Ring(..))) {
        TestKind::Bore
    } else {
        TestKind::Touch
    };
    let first = groups.first();
    let centre_mm = first.map(|group| group.shape.centre_mm(&group.points));
    TestSegment {
        centre_mm: centre_mm.unwrap_or_default(),
        repeat: run - 1,
        zero_id: 1,
        setup_id: 1,
        features: groups.iter().map(|group| group.name.clone()).collect(),
        ..TestSegment::of_kind(kind, run, Stamp::from_nanos(0))
    }
}

fn position(at_mm: Vector3<f64>) -> PerAxis<f64> {
    let mut position = PerAxis::default();
    for axis in Axis::LINEAR {
        position[axis] = at_mm[axis.index()];
    }
    position
}

fn point(row: &Row, shape: &Shape, (feature_id, sequence): (String, u32)) -> ProbedPoint {
    let at_mm = place(row);
    let inwards = |centre_mm: &Vector3<f64>| (centre_mm - at_mm).try_normalize(0.0);
    let approach = match shape {
        Shape::Place(along) => Some(*along),
        Shape::Sphere(round) | Shape::Ring(round, _) => inwards(&round.centre_mm),
    };
    ProbedPoint {
        received_at: Stamp::from_nanos(0),
        feature_id,
        axes_at_contact: position(at_mm),
        axes: AxisSet::XYZ,
        point_in_machine_mm: at_mm,
        point_in_workpiece_mm: at_mm,
        applied_latency_s: 0.0,
        correction: Correction::None,
        standard_uncertainty_mm: 0.0,
        approach: approach.unwrap_or_else(Vector3::z),
        feed_mm_s: 0.0,
        rejection: Rejection::None,
        sequence,
    }
}

/// The shape of touches; none of one place.
fn fitted(group: &Group, run: u32) -> Option<ProbedFeature> {
    let (kind, round, normal) = match &group.shape {
        Shape::Place(_) => return None,
        Shape::Sphere(round) => (FeatureKind::Sphere, round, Vector3::zeros()),
        Shape::Ring(round, normal) => (FeatureKind::Bore, round, *normal),
    };
    Some(ProbedFeature {
        at: Stamp::from_nanos(0),
        feature_id: group.name.clone(),
        kind,
        centre_mm: round.centre_mm,
        centre_covariance_mm2: Matrix3::zeros(),
        normal,
        normal_standard_uncertainty_rad: f64::NAN,
        radius_mm: round.radius_mm,
        radius_standard_uncertainty_mm: f64::NAN,
        form_mm: round.form_mm,
        n: u32::try_from(group.points.len()).unwrap_or(u32::MAX),
        n_rejected: 0,
        run,
        rotary_axes: AxisSet::default(),
        rotary_rad: PerAxis::default(),
    })
}
