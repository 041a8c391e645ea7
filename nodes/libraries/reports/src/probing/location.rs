//! ISO 230-10: how the centre of a sphere, ring or boss comes out when it is measured again and again.
//!
//! Measurements belong together when their runs repeat one test, one directly after another, and the rotary axes stand
//! alike.

use std::collections::BTreeMap;

use iso230::ExpandedLength;
use iso230::probing::{REPETITIONS, location};
use metrology::Axis;
use metrology::sample::{FeatureKind, ProbedFeature, TestSegment};
use serde::Serialize;
use serde_json::json;

use super::{drift_mm, is_list, kind, lists, pose};
use crate::evaluate::Tests;
use crate::evaluate::budget::Budget;
use crate::evaluate::imported::Imported;
use crate::positioning::figure;
use crate::section::{Rows, Section, head, um};

/// Rotary axes that differ by less stand alike, rad.
const SAME_POSE_RAD: f64 = 1e-2;

/// One feature measured again and again.
#[derive(Serialize)]
struct Repeats {
    feature: String,
    first_run: u32,
    kind: &'static str,
    pose: String,
    measurements: usize,
    /// None where nobody stated times.
    hours: Option<f64>,
    /// R in X, Y and, of a sphere, Z; of a ring in another plane along its axes.
    repeatability: Vec<ExpandedLength>,
    /// Along which axes, in their order.
    axes: Vec<Axis>,
}

/// The part, where a feature was measured twice.
pub(super) fn section(tests: &Tests, budget: Option<&Budget>) -> Option<Section> {
    let drift_mm = drift_mm(budget);
    let imported = tests.conditions.imported.as_ref();
    let is_made_up = imported.is_some_and(Imported::is_motion_made_up);
    let found: Vec<Repeats> = groups(tests)
        .iter()
        .filter_map(|group| Repeats::of(group, drift_mm))
        .map(|found| Repeats {
            hours: found.hours.filter(|_| !is_made_up),
            ..found
        })
        .collect();
    (!found.is_empty()).then(|| {
        let mut section = Section::new("Repeatability of location, ISO 230-10");
        if is_list(tests) {
            found.iter().for_each(|one| section.answer(one.answer()));
        }
        section.tables.push(Rows {
            head: head(&[
                "feature",
                "measurements",
                "within / h",
                "R in X / µm",
                "R in Y / µm",
                "R in Z / µm",
            ]),
            rows: found.iter().map(|one| one.row(budget.is_some())).collect(),
            note: format!(
                "R_SPH of a sphere, R_CIR of a bore or boss: greatest minus least coordinate of its centre; {REPETITIONS} measurements are usual. What the machine drifts meanwhile is in it."
            ),
        });
        section.figures = json!({ "test": section.title, "iso230_10_location": found });
        if is_list(tests) {
            let all = found.iter().map(|one| (one.feature.as_str(), one.named()));
            section.figures["iso230_10_list"] = lists::by_feature(all);
        }
        section
    })
}

/// Which test each run repeats: the first run of those that follow one another.
fn series(touches: impl Iterator<Item = TestSegment>) -> BTreeMap<u32, u32> {
    let mut first_of = BTreeMap::new();
    let mut before: Option<(TestSegment, u32)> = None;
    for segment in touches {
        if before
            .as_ref()
            .is_some_and(|(last, _)| last.run == segment.run)
        {
            continue;
        }
        let goes_on = before.as_ref().filter(|(last, _)| {
            last.kind == segment.kind
                && last.features == segment.features
                && segment.repeat == last.repeat + 1
        });
        let first = goes_on.map_or(segment.run, |(_, first)| *first);
        first_of.insert(segment.run, first);
        before = Some((segment, first));
    }
    first_of
}

/// Measurements of one feature that repeat one another.
fn groups(tests: &Tests) -> Vec<Vec<&ProbedFeature>> {
    let first_of = series(tests.touches.iter().map(|(segment, _)| segment.clone()));
    let mut groups: Vec<(u32, Vec<&ProbedFeature>)> = vec![];
    for feature in &tests.features {
        if feature.kind == FeatureKind::Plane {
            continue;
        }
        let first = first_of.get(&feature.run).copied().unwrap_or(feature.run);
        let is_same = |(of, group): &&mut (u32, Vec<&ProbedFeature>)| {
            let known = group[0];
            *of == first && known.feature_id == feature.feature_id && stands_alike(known, feature)
        };
        match groups.iter_mut().find(is_same) {
            Some((_, group)) => group.push(feature),
            None => groups.push((first, vec![feature])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

fn stands_alike(a: &ProbedFeature, b: &ProbedFeature) -> bool {
    let near = |axis: &Axis| (a.rotary_rad[*axis] - b.rotary_rad[*axis]).abs() <= SAME_POSE_RAD;
    Axis::ROTARY.iter().all(near)
}

/// Axes along which the centre of a shape is found: of a ring those of its plane.
fn axes(feature: &ProbedFeature) -> Vec<Axis> {
    let normal = feature.normal.iamax();
    let is_tilted = feature.normal[normal].abs() > feature.normal.z.abs();
    let out = match feature.kind {
        FeatureKind::Sphere | FeatureKind::Plane => None,
        FeatureKind::Bore | FeatureKind::Boss if is_tilted => Some(normal),
        FeatureKind::Bore | FeatureKind::Boss => Some(Axis::Z.index()),
    };
    let linear = Axis::LINEAR.into_iter();
    linear.filter(|axis| Some(axis.index()) != out).collect()
}

impl Repeats {
    fn of(group: &[&ProbedFeature], drift_mm: f64) -> Option<Self> {
        let (first, last) = (group.first()?, group.last()?);
        let centres: Vec<_> = group.iter().map(|feature| feature.centre_mm).collect();
        let axes = axes(first);
        let result = match axes[..] {
            [one, other] => {
                let flat = |centre: &nalgebra::Vector3<f64>| {
                    nalgebra::Vector2::new(centre[one.index()], centre[other.index()])
                };
                location(&centres.iter().map(flat).collect::<Vec<_>>(), drift_mm)
            }
            _ => location(&centres, drift_mm),
        };
        // Fewer than two measurements repeat nothing.
        let result = result.ok()?;
        Some(Self {
            feature: first.feature_id.clone(),
            first_run: first.run,
            kind: kind(first),
            pose: pose(first),
            measurements: result.n,
            hours: Some((last.at - first.at).as_secs_f64() / 3600.0),
            repeatability: result.repeatability,
            axes,
        })
    }

    /// R along each axis, mm.
    fn named(&self) -> Vec<(&'static str, f64)> {
        let parts = self.axes.iter().zip(&self.repeatability);
        let name = |axis: &Axis| match axis {
            Axis::X => "location_x",
            Axis::Y => "location_y",
            _ => "location_z",
        };
        parts
            .map(|(axis, one)| (name(axis), one.value_mm))
            .collect()
    }

    fn answer(&self) -> String {
        let name = if self.kind == "sphere" {
            "R_SPH"
        } else {
            "R_CIR"
        };
        let parts = self.axes.iter().zip(&self.repeatability);
        let parts = parts.map(|(axis, one)| format!("{axis} {}", um(one.value_mm)));
        format!(
            "{name} {} µm, of {} measurements of {}; {REPETITIONS} are usual.",
            parts.collect::<Vec<_>>().join(", "),
            self.measurements,
            self.feature
        )
    }

    fn row(&self, stated: bool) -> Vec<String> {
        let cell = |axis: usize| {
            let place = self.axes.iter().position(|own| own.index() == axis);
            let found = place.and_then(|place| self.repeatability.get(place));
            found.map_or_else(|| um(f64::NAN), |one| figure(one, stated))
        };
        vec![
            format!("{}, run {} on{}", self.feature, self.first_run, self.pose),
            self.measurements.to_string(),
            { self.hours }.map_or_else(|| "not stated".to_owned(), |hours| format!("{hours:.2}")),
            cell(0),
            cell(1),
            cell(2),
        ]
    }
}

#[cfg(test)]
mod tests {
    use metrology::{AxisSet, PerAxis, Stamp};
    use nalgebra::{Matrix3, Vector3};

    use super::*;

    fn sphere(run: u32, centre_mm: [f64; 3], c_rad: f64) -> ProbedFeature {
        let mut rotary_rad = PerAxis::default();
        rotary_rad[Axis::C] = c_rad;
        ProbedFeature {
            at: Stamp::from_nanos(i64::from(run) * 36_000_000_000),
            feature_id: "high".to_owned(),
            kind: FeatureKind::Sphere,
            centre_mm: centre_mm.into(),
            centre_covariance_mm2: Matrix3::zeros(),
            normal: Vector3::zeros(),
            normal_standard_uncertainty_rad: f64::NAN,
            radius_mm: 12.5,
            radius_standard_uncertainty_mm: 0.0,
            form_mm: 0.0,
            n: 5,
            n_rejected: 0,
            run,
            rotary_axes: AxisSet::default(),
            rotary_rad,
        }
    }

    #[test]
    fn a_centre_repeats_by_its_range_at_one_pose_by_hand() {
        let tests = Tests {
            features: vec![
                sphere(1, [0.0, 0.0, 0.0], 0.0),
                sphere(1, [9.0, 9.0, 9.0], 1.0),
                sphere(1, [0.002, -0.001, 0.0005], 0.0),
                sphere(1, [0.001, 0.001, 0.0], 0.0),
            ],
            ..Tests::default()
        };
        let section = section(&tests, None).unwrap();
        let found = section.figures["iso230_10_location"].as_array().unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0]["measurements"], 3);
        for (axis, wanted) in [0.002, 0.002, 0.0005].into_iter().enumerate() {
            let value = found[0]["repeatability"][axis]["value_mm"]
                .as_f64()
                .unwrap();
            assert!((value - wanted).abs() < 1e-15, "{value}");
        }
    }
}
