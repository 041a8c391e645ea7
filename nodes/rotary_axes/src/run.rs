//! The visits of one rotary test.

use machine::{MachineFile, SphereDesign};
use metrology::sample::{ProbedFeature, TestSegment};
use metrology::stamp::Span;
use metrology::{Host, Stamp};
use nalgebra::{Matrix3, Vector3};

use crate::diagnostic::Diagnostic;
use crate::visit::SphereVisit;

/// Visits of one run, as many as a plan may have: doubtful ones are sought one by one, which takes as the square of them.
const MOST_VISITS: usize = 500;

/// A rotary test and what has come of it so far.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) begin: TestSegment,
    pub(crate) visits: Vec<SphereVisit>,
    /// Spheres that were told: when and where each was found.
    pub(crate) told: Vec<(Stamp<Host>, Vector3<f64>)>,
    /// When its end was told, and whether it was completed.
    pub(crate) end: Option<(Stamp<Host>, bool)>,
}

impl Run {
    pub(crate) const fn number(&self) -> u32 {
        self.begin.run
    }

    /// The visit that a feature is, or why it is none.
    pub(crate) fn visit(
        &self,
        feature: &ProbedFeature,
        (file, design): (&MachineFile, &SphereDesign),
        pose_repeatability_mm: f64,
    ) -> Result<SphereVisit, Diagnostic> {
        let (run, sphere) = (self.number(), feature.feature_id.clone());
        let held = self.visits.len();
        if held >= MOST_VISITS {
            return Err(Diagnostic::TooManyVisits { run, held, sphere });
        }
        if self.told.contains(&(feature.at, feature.centre_mm)) {
            return Err(Diagnostic::ToldBefore { run, sphere });
        }
        if feature.at + LATE < self.begin.at {
            let before_s = (self.begin.at - feature.at).as_secs_f64();
            return Err(Diagnostic::OfAnotherTime {
                run,
                sphere,
                before_s,
            });
        }
        if !self.begin.features.is_empty() && !self.begin.features.contains(&sphere) {
            return Err(Diagnostic::OtherSphere { run, sphere });
        }
        let numbers = feature
            .centre_mm
            .iter()
            .chain(&feature.centre_covariance_mm2);
        let mut poses = design
            .rotary_axes()
            .iter()
            .map(|&axis| feature.rotary_rad[axis]);
        if !numbers.copied().all(f64::is_finite) || !poses.all(f64::is_finite) {
            return Err(Diagnostic::NotFinite { run, sphere });
        }
        for &axis in design.rotary_axes() {
            let position_deg = feature.rotary_rad[axis].to_degrees();
            let travel_deg = file
                .rotary_axis(axis)
                .map_or([0.0; 2], |entry| entry.travel_deg);
            // A servo stands a little beside its command.
            let [least, greatest] = [travel_deg[0] - BESIDE_DEG, travel_deg[1] + BESIDE_DEG];
            if !(least..=greatest).contains(&position_deg) {
                return Err(Diagnostic::OutsideTravel {
                    run,
                    sphere,
                    axis,
                    position_deg,
                    travel_deg,
                });
            }
        }
        let covariance_mm2 =
            feature.centre_covariance_mm2 + Matrix3::identity() * pose_repeatability_mm.powi(2);
        if covariance_mm2.cholesky().is_none() {
            return Err(Diagnostic::NotFinite { run, sphere });
        }
        Ok(SphereVisit {
            sphere,
            pose_rad: feature.rotary_rad,
            centre_mm: feature.centre_mm,
            covariance_mm2,
            known_mm: Vector3::zeros(),
        })
    }

    /// Poses that have fewer visits than the others: a sphere was not found there.
    pub(crate) fn missing(&self, design: &SphereDesign) -> Vec<Diagnostic> {
        let mut poses: Vec<(&SphereVisit, Vec<(&str, u32)>)> = Vec::new();
        let mut spheres: Vec<&str> = Vec::new();
        for visit in &self.visits {
            if !spheres.contains(&visit.sphere.as_str()) {
                spheres.push(&visit.sphere);
            }
            let same = |other: &SphereVisit| {
                let other = SphereVisit {
                    sphere: visit.sphere.clone(),
                    ..other.clone()
                };
                visit.repeats(&other, design)
            };
            let place = poses
                .iter()
                .position(|(first, _)| same(first))
                .unwrap_or_else(|| {
                    poses.push((visit, Vec::new()));
                    poses.len() - 1
                });
            let counts = &mut poses[place].1;
            match counts.iter_mut().find(|(name, _)| *name == visit.sphere) {
                Some((_, n)) => *n += 1,
                None => counts.push((&visit.sphere, 1)),
            }
        }
        let most = poses
            .iter()
            .flat_map(|(_, counts)| counts)
            .map(|(_, n)| *n)
            .max();
        let expected = most.unwrap_or(0);
        let mut missing = Vec::new();
        for (first, counts) in &poses {
            for sphere in &spheres {
                let found = counts
                    .iter()
                    .find(|(name, _)| name == sphere)
                    .map_or(0, |(_, n)| *n);
                if found < expected {
                    missing.push(Diagnostic::VisitMissing {
                        run: self.number(),
                        sphere: (*sphere).to_owned(),
                        pose: design
                            .rotary_axes()
                            .iter()
                            .map(|&axis| (axis, first.pose_rad[axis].to_degrees()))
                            .collect(),
                        found,
                        expected,
                    });
                }
            }
        }
        missing
    }
}

/// How far the clocks of hosts may be apart.
pub(crate) const LATE: Span = Span::from_nanos(2_000_000_000);
/// How far a servo may stand beyond the end of the travel, deg.
const BESIDE_DEG: f64 = 0.01;
