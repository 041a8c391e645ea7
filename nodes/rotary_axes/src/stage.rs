//! The node's whole computation: probed spheres and segments in, models of the rotary axes out.
//!
//! The probe evaluates a run a little after its end, and the next run may have begun by then: spheres
//! are sorted by the number of their run, and a run is evaluated `hold_ms` after its end. Spheres and segments come on two
//! topics, which have no order: spheres that overtake the begin of their run wait for it. A rotary
//! test of a sphere replaces an earlier one of the same sphere and is put together with those of other
//! spheres of the same set-up; another set-up begins anew.

use std::collections::VecDeque;

use machine::file::ArtefactEntry;
use machine::volumetric::VolumetricModel;
use machine::{MachineFile, SphereDesign};
use metrology::sample::{FeatureKind, GeometryModel, ProbedFeature, TestKind, TestSegment};
use metrology::stamp::Span;
use metrology::{Host, Stage, Stamp};
use nalgebra::Vector3;

use crate::allowance::{Allowance, Known};
use crate::config::RotaryAxesConfig;
use crate::diagnostic::{Diagnostic, LinearRefusal};
use crate::error::{EstimateError, RotaryAxesError};
use crate::estimate::{EstimateRules, RotaryEstimate, estimate};
use crate::published::published;
use crate::run::Run;
use crate::unknown::Unknown;
use crate::verification::{Verification, verify};
use crate::visit::SphereVisit;

/// What the node is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// A sphere, or another shape.
    Feature(ProbedFeature),
    /// Begin or end of a test.
    Segment(TestSegment),
    /// Errors of the linear axes, which are taken off the readings.
    Linear(GeometryModel),
    /// Time passes.
    Tick,
}

/// What the node says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Location errors, and error motions where they were needed.
    Model(GeometryModel),
    /// Everything behind a model.
    Estimate(Box<RotaryEstimate>),
    /// A verification, visit by visit.
    Verification(Box<Verification>),
    /// A condition worth reporting.
    Diagnostic(Diagnostic),
}

/// Spheres that wait for the begin of their run; of more the oldest is forgotten, for runs of other kinds begin elsewhere.
const MOST_WAITING: usize = 500;

/// The node's computation.
#[derive(Clone, Debug)]
pub struct RotaryAxesStage {
    file: MachineFile,
    design: SphereDesign,
    rules: EstimateRules,
    hold: Span,
    pose_repeatability_mm: f64,
    least_merit: f64,
    runs: VecDeque<Run>,
    waiting: VecDeque<ProbedFeature>,
    /// The run that was evaluated last, and when its end came: numbers begin anew when a sequencer does.
    evaluated: Option<(u32, Stamp<Host>)>,
    setup_id: u32,
    visits: Vec<SphereVisit>,
    found: Option<RotaryEstimate>,
    linear: Option<(VolumetricModel, GeometryModel)>,
    allowance: Option<Allowance>,
    sequence: u32,
}

impl RotaryAxesStage {
    /// From parameters and machine file.
    ///
    /// # Errors
    /// Parameters out of range, a machine without rotary axes or with linear ones that they move.
    pub fn new(config: &RotaryAxesConfig, file: &MachineFile) -> Result<Self, RotaryAxesError> {
        config.check()?;
        Ok(Self {
            design: SphereDesign::new(file)?,
            file: file.clone(),
            rules: config.rules(),
            hold: config.hold(),
            pose_repeatability_mm: config.pose_repeatability_um / 1e3,
            least_merit: config.least_merit,
            runs: VecDeque::new(),
            waiting: VecDeque::new(),
            evaluated: None,
            setup_id: 0,
            visits: Vec::new(),
            found: None,
            linear: None,
            allowance: config.allowance,
            sequence: 0,
        })
    }

    fn take_segment(
        &mut self,
        at: Stamp<Host>,
        segment: TestSegment,
        out: &mut Vec<Output>,
    ) -> Result<(), RotaryAxesError> {
        if !matches!(
            segment.kind,
            TestKind::Rotary | TestKind::RotaryVerification
        ) {
            return Ok(());
        }
        let number = segment.run;
        if segment.begin {
            // One program runs at a time: what is open now will not end.
            let open = self.runs.iter().position(|run| run.end.is_none());
            if let Some(open) = open.and_then(|place| self.runs.remove(place)) {
                out.push(say(Diagnostic::NotBracketed { run: open.number() }));
            }
            self.runs.push_back(Run {
                begin: segment,
                visits: Vec::new(),
                told: Vec::new(),
                end: None,
            });
            return self.take_waiting(out);
        } else if let Some(run) = self.runs.iter_mut().find(|run| run.number() == number) {
            run.end = Some((at, segment.completed));
        } else {
            out.push(say(Diagnostic::NotBracketed { run: number }));
        }
        Ok(())
    }

    /// Takes the spheres that overtook the begin of their run, all of them whatever one of them lacks.
    fn take_waiting(&mut self, out: &mut Vec<Output>) -> Result<(), RotaryAxesError> {
        let Some(run) = self.runs.back().map(Run::number) else {
            return Ok(());
        };
        let waiting = std::mem::take(&mut self.waiting).into_iter();
        let (of_run, others) = waiting.partition::<VecDeque<_>, _>(|feature| feature.run == run);
        self.waiting = others;
        let taken = of_run.iter().map(|feature| self.take_feature(feature, out));
        taken.fold(Ok(()), Result::and)
    }

    /// A sphere of a run that is over, or of one that has not begun here.
    fn take_without_run(&mut self, feature: &ProbedFeature, out: &mut Vec<Output>) {
        if feature.kind != FeatureKind::Sphere {
            return;
        }
        let is_late = |(run, ended): (u32, Stamp<Host>)| run == feature.run && feature.at <= ended;
        if self.evaluated.is_some_and(is_late) {
            out.push(say(Diagnostic::TooLate {
                run: feature.run,
                sphere: feature.feature_id.clone(),
            }));
            return;
        }
        if self.waiting.len() >= MOST_WAITING {
            self.waiting.pop_front();
        }
        self.waiting.push_back(feature.clone());
    }

    fn take_feature(
        &mut self,
        feature: &ProbedFeature,
        out: &mut Vec<Output>,
    ) -> Result<(), RotaryAxesError> {
        let machine = (&self.file, &self.design);
        let Some(run) = self.runs.iter_mut().find(|run| run.number() == feature.run) else {
            self.take_without_run(feature, out);
            return Ok(());
        };
        let mut turning = self.design.rotary_axes().iter();
        if let Some(&axis) = turning.find(|axis| !feature.rotary_axes.contains(**axis)) {
            return Err(RotaryAxesError::AxisMissing {
                run: feature.run,
                sphere: feature.feature_id.clone(),
                axis,
            });
        }
        let is_sphere = feature.kind == FeatureKind::Sphere
            && nominal_place(&self.file, &feature.feature_id).is_some();
        if !is_sphere {
            out.push(say(Diagnostic::UnknownSphere {
                run: feature.run,
                sphere: feature.feature_id.clone(),
            }));
            return Ok(());
        }
        match run.visit(feature, machine, self.pose_repeatability_mm) {
            Ok(visit) => {
                run.visits.push(visit);
                run.told.push((feature.at, feature.centre_mm));
            }
            Err(diagnostic) => out.push(say(diagnostic)),
        }
        Ok(())
    }

    /// Evaluates runs that ended long enough ago, in order.
    fn settle(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        while let Some(run) = self.runs.front_mut() {
            let Some((ended, completed)) = run.end.as_mut() else {
                return;
            };
            *ended = (*ended).min(at); // host time went back: the wait begins anew
            if at - *ended < self.hold {
                return;
            }
            let (ended, completed) = (*ended, *completed);
            let Some(run) = self.runs.pop_front() else {
                return;
            };
            self.evaluated = Some((run.number(), ended));
            if completed {
                self.evaluate(at, run, out);
            } else {
                out.push(say(Diagnostic::NotCompleted { run: run.number() }));
            }
        }
    }

    fn evaluate(&mut self, at: Stamp<Host>, mut run: Run, out: &mut Vec<Output>) {
        out.extend(run.missing(&self.design).into_iter().map(say));
        if let Err(reason) = self.take_off_linear(&mut run.visits) {
            let reason = LinearRefusal::Pose(reason);
            out.push(say(Diagnostic::LinearModelRefused {
                run: run.number(),
                reason,
            }));
            return;
        }
        if run.begin.kind == TestKind::RotaryVerification {
            self.verify(&run, out);
        } else {
            self.calibrate(at, run, out);
        }
    }

    /// What the linear axes are known to add to each reading.
    fn take_off_linear(
        &self,
        visits: &mut [SphereVisit],
    ) -> Result<(), machine::volumetric::PoseRefusal> {
        let Some((linear, _)) = &self.linear else {
            return Ok(());
        };
        for visit in visits {
            let Some(place) = nominal_place(&self.file, &visit.sphere) else {
                continue;
            };
            let row = self.design.row(&place, &visit.pose_rad);
            let error_mm = linear.tip_error_mm(&row.positions, &Vector3::zeros())?;
            visit.known_mm = -(row.machine_from_workpiece * error_mm);
        }
        Ok(())
    }

    fn calibrate(&mut self, at: Stamp<Host>, run: Run, out: &mut Vec<Output>) {
        let number = run.number();
        if run.begin.setup_id != self.setup_id {
            self.visits.clear();
            self.setup_id = run.begin.setup_id;
        }
        let mut visits = self.visits.clone();
        visits.retain(|known| run.visits.iter().all(|visit| visit.sphere != known.sphere));
        visits.extend(run.visits);
        let spheres = self.spheres(&visits);
        match estimate(&self.design, &visits, &spheres, &self.rules) {
            Ok(found) => {
                let found = found.with_common(&self.design, self.known());
                self.visits = visits;
                self.report(number, &found, out);
                self.sequence += 1;
                out.push(Output::Model(published(
                    at,
                    self.sequence,
                    &self.file,
                    &self.design,
                    &found,
                )));
                out.push(Output::Estimate(Box::new(found.clone())));
                self.found = Some(found);
            }
            Err(reason) => {
                // One sphere may be the first of several in this set-up.
                if matches!(reason, EstimateError::TooFewVisits { .. }) {
                    self.visits = visits;
                }
                out.push(say(Diagnostic::NotEstimated {
                    run: number,
                    reason,
                }));
            }
        }
    }

    fn report(&self, run: u32, found: &RotaryEstimate, out: &mut Vec<Output>) {
        let is_harmonic = |unknown: &&Unknown| !matches!(unknown, Unknown::Location(_));
        let used = found.residuals.iter().filter(|left| !left.doubtful);
        out.push(say(Diagnostic::Calibrated {
            run,
            visits: used.count(),
            spheres: found.spheres.len(),
            merit: found.merit.merit,
            before_mm: found.spatial_before_mm,
            after_mm: found.spatial_after_mm,
            harmonics: found.unknowns.iter().filter(is_harmonic).count() / 2,
            lack_of_fit_p: found.lack_of_fit_p,
        }));
        let open = found.unknowns.iter().zip(&found.fit.estimable);
        let names: Vec<String> = open
            .filter(|(_, estimable)| !**estimable)
            .map(|(unknown, _)| unknown.to_string())
            .collect();
        if !names.is_empty() {
            let names = names.join(", ");
            out.push(say(Diagnostic::NotEstimable { run, names }));
        }
        if self.allowance.is_none() {
            out.push(say(Diagnostic::NoAllowance { run }));
        }
        if found.merit.merit < self.least_merit {
            out.push(say(Diagnostic::LowMerit {
                run,
                merit: found.merit.merit,
                least: self.least_merit,
            }));
        }
        for left in found.residuals.iter().filter(|left| left.doubtful) {
            let axes = self.design.rotary_axes().iter();
            out.push(say(Diagnostic::Doubtful {
                run,
                sphere: left.visit.sphere.clone(),
                pose: axes
                    .map(|&axis| (axis, left.visit.pose_rad[axis].to_degrees()))
                    .collect(),
                off_mm: left.residual_mm.norm(),
            }));
        }
        if found.lack_of_fit_p < self.rules.lack_of_fit_p {
            out.push(say(Diagnostic::LackOfFit {
                run,
                p: found.lack_of_fit_p,
                enlargement: found.enlargement,
            }));
        }
    }

    /// What is known besides the visits.
    fn known(&self) -> Known<'_> {
        Known {
            allowance: self.allowance.as_ref(),
            linear: self.linear.as_ref().map(|(_, model)| model),
        }
    }

    fn verify(&self, run: &Run, out: &mut Vec<Output>) {
        let number = run.number();
        let (Some(found), false) = (&self.found, run.visits.is_empty()) else {
            out.push(say(Diagnostic::NothingToVerify { run: number }));
            return;
        };
        let spheres = self.spheres(&run.visits);
        let same_setup = run.begin.setup_id == self.setup_id;
        let known = self.known();
        match verify(
            &self.design,
            found,
            known,
            &run.visits,
            &spheres,
            same_setup,
        ) {
            Ok(verified) => {
                out.push(say(Diagnostic::Verified {
                    run: number,
                    visits: verified.visits.len(),
                    before_mm: verified.rms_before_mm,
                    after_mm: verified.rms_after_mm,
                    greatest_mm: verified.greatest_after_mm,
                    expected_mm: verified.expected_mm,
                    allowed_mm: verified.allowed_mm,
                    allowed_p: verified.judged.p,
                    same_places: verified.same_places,
                }));
                if verified.judged.p < self.rules.lack_of_fit_p {
                    out.push(say(Diagnostic::BeyondExpected {
                        run: number,
                        after_mm: verified.rms_after_mm,
                        allowed_mm: verified.allowed_mm,
                        p: verified.judged.p,
                        reason: verified.judged.reason,
                        has_allowance: self.allowance.is_some(),
                    }));
                }
                out.push(Output::Verification(Box::new(verified)));
            }
            Err(reason) => out.push(say(Diagnostic::NotEstimated {
                run: number,
                reason,
            })),
        }
    }

    /// Spheres that were visited, with their nominal places.
    fn spheres(&self, visits: &[SphereVisit]) -> Vec<(String, Vector3<f64>)> {
        let mut spheres: Vec<(String, Vector3<f64>)> = Vec::new();
        for visit in visits {
            if spheres.iter().all(|(name, _)| *name != visit.sphere)
                && let Some(place) = nominal_place(&self.file, &visit.sphere)
            {
                spheres.push((visit.sphere.clone(), place));
            }
        }
        spheres
    }

    fn take_linear(&mut self, model: &GeometryModel, out: &mut Vec<Output>) {
        match VolumetricModel::new(self.design.kinematics(), model) {
            Ok(linear) => {
                self.linear = Some((linear, model.clone()));
                // What was visited before it came is put together with what comes.
                let mut visits = std::mem::take(&mut self.visits);
                if let Err(reason) = self.take_off_linear(&mut visits) {
                    out.push(say(Diagnostic::LinearModelRefused {
                        run: 0,
                        reason: LinearRefusal::Pose(reason),
                    }));
                }
                self.visits = visits;
            }
            Err(error) => out.push(say(Diagnostic::LinearModelRefused {
                run: 0,
                reason: LinearRefusal::Model(error),
            })),
        }
    }
}

fn say(diagnostic: Diagnostic) -> Output {
    Output::Diagnostic(diagnostic)
}

/// Nominal centre of a sphere of the machine file, mm.
fn nominal_place(file: &MachineFile, name: &str) -> Option<Vector3<f64>> {
    file.artefacts.iter().find_map(|entry| match entry {
        ArtefactEntry::Sphere { id, centre_mm, .. } if id == name => {
            Some(Vector3::from(*centre_mm))
        }
        _ => None,
    })
}

impl Stage for RotaryAxesStage {
    type Input = Input;
    type Output = Output;
    type Error = RotaryAxesError;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), RotaryAxesError> {
        match input {
            Input::Feature(feature) => self.take_feature(&feature, out)?,
            Input::Segment(segment) => self.take_segment(at, segment, out)?,
            Input::Linear(model) => self.take_linear(&model, out),
            Input::Tick => {}
        }
        self.settle(at, out);
        Ok(())
    }
}
