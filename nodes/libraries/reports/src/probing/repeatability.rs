//! ISO 230-10: how touches of one place repeat.
//!
//! Touches are of one place when feature, run, feed and direction of approach are the same, the rotary axes stand
//! alike, and their surface points lie within 0.5 mm of the first one.

use std::collections::BTreeMap;

use iso230::ExpandedLength;
use iso230::probing::{REPETITIONS, single_point};
use metrology::Axis;
use metrology::sample::{ProbedPoint, Rejection};
use serde::Serialize;
use serde_json::json;

use crate::evaluate::Tests;
use crate::evaluate::budget::Budget;
use crate::positioning::figure;
use crate::section::{Rows, Section, head, um};

/// Fewest touches of one place whose spread says anything.
const LEAST_TOUCHES: usize = 5;
/// Surface points that are no farther apart are of one place, mm: far above what touches scatter and a machine drifts
/// within a run, far below the distance of two places of a plan.
const SAME_PLACE_MM: f64 = 0.5;
/// Approaches (as unit vectors) and rotary axes that differ by less are alike, rad: 0.6°, far above what a feed's
/// direction scatters and a pose is held to, far below the distance of two poses.
const SAME_DIRECTION_RAD: f64 = 1e-2;

/// A touch with the number of its run.
type Touch<'a> = (u32, &'a ProbedPoint);

/// The part, where a place was touched often enough.
pub(super) fn section(tests: &Tests, budget: Option<&Budget>) -> Option<Section> {
    let drift_mm = super::drift_mm(budget);
    let touches = { tests.touches.iter() }
        .filter(|(_, point)| point.rejection == Rejection::None)
        .map(|(segment, point)| (segment.run, point));
    let spreads: Vec<Spread> = places(touches)
        .iter()
        .filter(|place| place.len() >= LEAST_TOUCHES)
        .filter_map(|place| Spread::of(place, drift_mm))
        .collect();
    (!spreads.is_empty()).then(|| {
        let mut section = Section::new("Repeatability of touches, ISO 230-10");
        if super::is_list(tests) {
            spreads.iter().for_each(|spread| section.answer(spread.answer()));
        }
        section.tables.push(Rows {
            head: head(&["feature", "place / mm", "feed / mm/min", "touches", "R_SPT / µm", "s / µm", "drift / µm"]),
            rows: spreads.iter().map(|spread| spread.row(budget.is_some())).collect(),
            note: format!(
                "R_SPT: single-point repeatability, greatest minus least touch along the approach; {REPETITIONS} touches are usual. One place: same feature, run and feed, direction of approach and rotary axes \
                 within 0.6°, surface points within {SAME_PLACE_MM} mm of the first one. Drift: from first to last touch on the least-squares line over their order. Fewer than {LEAST_TOUCHES} touches are not shown."
            ),
        });
        section.figures = json!({ "test": section.title, "iso230_10_repeatability": spreads });
        if super::is_list(tests) {
            let all = spreads.iter().map(|one| (one.feature(), one.named()));
            section.figures["iso230_10_list"] = super::lists::by_feature(all);
        }
        section
    })
}

/// Touches of one place together, by run, feature and feed, then in the order of the first of each.
fn places<'a>(touches: impl Iterator<Item = Touch<'a>>) -> Vec<Vec<Touch<'a>>> {
    let mut groups: BTreeMap<(u32, &str, i64), Vec<Vec<Touch>>> = BTreeMap::new();
    for touch in touches {
        let (run, point) = touch;
        let key = (run, point.feature_id.as_str(), feed_mm_min(point));
        let known = groups.entry(key).or_default();
        match known.iter_mut().find(|place| is_at(place[0].1, point)) {
            Some(place) => place.push(touch),
            None => known.push(vec![touch]),
        }
    }
    groups.into_values().flatten().collect()
}

fn feed_mm_min(point: &ProbedPoint) -> i64 {
    (point.feed_mm_s * 60.0).round() as i64
}

/// Whether a touch is of the place of another one.
fn is_at(place: &ProbedPoint, point: &ProbedPoint) -> bool {
    let stands_alike = |axis: &Axis| {
        let by_rad = place.axes_at_contact[*axis] - point.axes_at_contact[*axis];
        by_rad.abs() <= SAME_DIRECTION_RAD
    };
    let rotary = Axis::ROTARY
        .iter()
        .filter(|axis| point.axes.contains(**axis));
    (place.point_in_machine_mm - point.point_in_machine_mm).norm() <= SAME_PLACE_MM
        && (place.approach - point.approach).norm() <= SAME_DIRECTION_RAD
        && rotary.into_iter().all(stands_alike)
}

/// Spread of the touches of one place.
#[derive(Serialize)]
struct Spread {
    test: String,
    /// The first surface point in the machine frame.
    place_mm: [f64; 3],
    feed_mm_min: i64,
    touches: usize,
    range_mm: f64,
    standard_deviation_mm: f64,
    /// From first to last touch on the line over their order.
    drift_mm: f64,
    repeatability: ExpandedLength,
}

impl Spread {
    /// Of at least two touches; nothing where a number is not finite.
    fn of(place: &[Touch], drift_mm: f64) -> Option<Self> {
        let (run, first) = place[0];
        let along_mm = |(_, point): &Touch| point.point_in_machine_mm.dot(&first.approach);
        let values: Vec<f64> = place.iter().map(along_mm).collect();
        let found = single_point(&values, drift_mm).ok()?;
        Some(Self {
            test: format!("{}, run {run}", first.feature_id),
            place_mm: first.point_in_machine_mm.into(),
            feed_mm_min: feed_mm_min(first),
            touches: values.len(),
            range_mm: found.repeatability.value_mm,
            standard_deviation_mm: found.standard_deviation_mm,
            drift_mm: drift_mm_of(&values),
            repeatability: found.repeatability,
        })
    }

    fn row(&self, stated: bool) -> Vec<String> {
        let [x, y, z] = self.place_mm;
        vec![
            self.test.clone(),
            format!("({x:.1}, {y:.1}, {z:.1})"),
            match self.feed_mm_min {
                0 => "not stated".to_owned(),
                feed_mm_min => feed_mm_min.to_string(),
            },
            self.touches.to_string(),
            figure(&self.repeatability, stated),
            um(self.standard_deviation_mm),
            um(self.drift_mm),
        ]
    }

    fn feature(&self) -> &str {
        let name = self.test.rsplit_once(", run ");
        name.map_or(self.test.as_str(), |(name, _)| name)
    }

    fn named(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("repeatability", self.range_mm),
            ("standard_deviation", self.standard_deviation_mm),
            ("drift", self.drift_mm),
        ]
    }

    fn answer(&self) -> String {
        let asked = match self.touches == REPETITIONS {
            true => String::new(),
            false => format!("; {REPETITIONS} are usual"),
        };
        format!(
            "R_SPT {} µm, s {} µm, drift {} µm from first to last, of {} touches of {}{asked}.",
            um(self.range_mm),
            um(self.standard_deviation_mm),
            um(self.drift_mm),
            self.touches,
            self.test
        )
    }
}

/// Slope of the least-squares line over the order of values, times the steps from the first to the last.
fn drift_mm_of(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let middle = (n - 1.0) / 2.0;
    let places = (0..values.len()).map(|k| k as f64 - middle);
    let (mut product, mut square) = (0.0, 0.0);
    for (place, value) in places.zip(values) {
        product += place * value;
        square += place * place;
    }
    if square > 0.0 {
        product / square * (n - 1.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::sample::Correction;
    use metrology::{AxisSet, PerAxis, Stamp};
    use nalgebra::Vector3;

    /// A sphere on a table that is turned to `c_deg`, touched from above, `off_um` from where it should be.
    fn touch(c_deg: f64, off_um: f64) -> ProbedPoint {
        let c_rad = f64::to_radians(c_deg);
        let mut axes_at_contact = PerAxis::default();
        axes_at_contact[Axis::C] = c_rad;
        ProbedPoint {
            received_at: Stamp::from_nanos(0),
            feature_id: "high.1".to_owned(),
            axes_at_contact,
            axes: AxisSet::XYZ.with(Axis::C),
            point_in_machine_mm: Vector3::new(
                100.0 * c_rad.cos(),
                100.0 * c_rad.sin(),
                50.0 + c_rad + off_um * 1e-3,
            ),
            point_in_workpiece_mm: Vector3::zeros(),
            applied_latency_s: 0.0,
            correction: Correction::None,
            standard_uncertainty_mm: 0.0,
            approach: -Vector3::z(),
            feed_mm_s: 8.0,
            rejection: Rejection::None,
            sequence: 0,
        }
    }

    #[test]
    fn touches_at_other_poses_are_no_repeats_and_those_of_one_pose_are() {
        // Six poses, and five rounds of two of them.
        let poses: Vec<ProbedPoint> = (0..6).map(|k| touch(f64::from(k) * 60.0, 0.0)).collect();
        let of_poses = places(poses.iter().map(|point| (1, point)));
        assert!(of_poses.iter().all(|place| place.len() == 1));
        let rounds: Vec<ProbedPoint> = (0..5)
            .flat_map(|k| [touch(0.0, f64::from(k)), touch(180.0, 2.0 * f64::from(k))])
            .collect();
        let of_rounds = places(rounds.iter().map(|point| (1, point)));
        let spreads = of_rounds
            .iter()
            .filter_map(|place| Spread::of(place, 0.0006));
        let spreads: Vec<Spread> = spreads.collect();
        let told: Vec<(usize, f64)> = spreads
            .iter()
            .map(|spread| (spread.touches, (spread.range_mm * 1e6).round()))
            .collect();
        assert_eq!(told, [(5, 4000.0), (5, 8000.0)]);
        assert!((spreads[1].place_mm[0] + 100.0).abs() < 1e-9);
        // By hand: each touch by 0.3 µm either way, rectangular; two of them, k = 2.
        let expanded_um = 2.0 * (2.0_f64 * 0.3 * 0.3 / 3.0).sqrt();
        let found = spreads[0].repeatability.expanded_uncertainty_mm;
        assert!((found * 1e3 - expanded_um).abs() < 1e-9, "{found}");
    }
}
