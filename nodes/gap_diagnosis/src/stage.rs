//! The node's whole computation: samples in, a diagnosis of the last runs out.
//!
//! After each segment that was recorded whole, and at most every `least_period_s`, the last runs are diagnosed as a
//! bag of them would be. An effect that was not named in the diagnosis before is told of by itself.

use std::collections::BTreeSet;

use machine::MachineFile;
use metrology::sample::{GapCause, GapParameter, GapStatus, GapSummary};
use metrology::stamp::Span;
use metrology::{Host, Stage, Stamp};

use crate::config::GapConfig;
use crate::diagnose::{Diagnosis, diagnose};
use crate::error::GapError;
use crate::following::GapDiagnosisConfig;
use crate::report::{Cause, GapReport, Status};
use crate::session::{self, SessionBuilder, SessionConfig};

/// What the node is told.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "nearly every input is a sample, and a box would be an allocation at every servo tick"
)]
pub enum Input {
    /// A recorded sample.
    Sample(session::Input),
    /// Time passes.
    Tick,
}

/// What the node says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// A diagnosis.
    Report(Box<GapSummary>),
    /// An effect that was not named before: its id, what it acts on, its size in words.
    NewEffect {
        /// Id and what it acts on.
        effect: String,
        /// Parameters with their values.
        size: String,
        /// Probability.
        confidence: f64,
    },
    /// A rest that no effect explains, where there was none before.
    NewRest {
        /// What it goes with.
        covariate: String,
    },
    /// No diagnosis can be made of the last runs, and why.
    NotYet(GapError),
    /// Samples that could not be used since the start, in words.
    LeftOut(Vec<String>),
}

/// The computation.
#[derive(Clone, Debug)]
pub struct GapDiagnosisStage {
    config: GapDiagnosisConfig,
    gap: GapConfig,
    machine: MachineFile,
    builder: SessionBuilder,
    last: Option<Stamp<Host>>,
    is_due: bool,
    named: BTreeSet<String>,
    had_rest: bool,
    remarks: Vec<String>,
}

impl GapDiagnosisStage {
    /// From parameters and machine file.
    ///
    /// # Errors
    /// Parameters out of range, a chain that cannot be read, known effects that the catalogue does not have.
    pub fn new(config: &GapDiagnosisConfig, machine: &MachineFile) -> Result<Self, GapError> {
        machine::effects::known(machine)?;
        Ok(Self {
            gap: config.gap_config()?,
            builder: SessionBuilder::new(machine, SessionConfig::default())?,
            config: config.clone(),
            machine: machine.clone(),
            last: None,
            is_due: false,
            named: BTreeSet::new(),
            had_rest: false,
            remarks: vec![],
        })
    }

    fn sample(&mut self, sample: session::Input) {
        let ends = matches!(&sample, session::Input::Segment(segment) if !segment.begin);
        self.builder.take(sample);
        if ends {
            self.builder.keep_last(self.config.last_runs);
            self.is_due |= self.builder.runs().len() >= self.config.least_runs;
        }
    }

    fn look(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let period = Span::from_secs_f64(self.config.least_period_s);
        let rested = self
            .last
            .is_none_or(|last| at - last >= period || at < last);
        if !(self.is_due && rested) {
            return;
        }
        self.is_due = false;
        self.last = Some(at);
        match diagnose(&self.machine, &self.builder.so_far(), &self.gap) {
            Ok(diagnosis) => self.tell(at, &diagnosis, out),
            Err(error) => out.push(Output::NotYet(error)),
        }
        let remarks: Vec<String> = self.builder.account().remarks().collect();
        if remarks != self.remarks {
            self.remarks.clone_from(&remarks);
            out.push(Output::LeftOut(remarks));
        }
    }

    fn tell(&mut self, at: Stamp<Host>, diagnosis: &Diagnosis, out: &mut Vec<Output>) {
        let report = &diagnosis.report;
        let runs = self.builder.runs().iter().map(|run| run.segment.run);
        out.push(Output::Report(Box::new(summary(
            at,
            runs.collect(),
            report,
        ))));
        let mut named = BTreeSet::new();
        let sure = report.causes.iter().filter(|cause| {
            cause.status == Status::Named && cause.confidence >= self.config.least_confidence
        });
        for cause in sure {
            let effect = format!("{} {}", cause.effect, cause.axis);
            let effect = effect.trim_end().to_owned();
            if !self.named.contains(&effect) {
                out.push(Output::NewEffect {
                    effect: effect.clone(),
                    size: size(cause),
                    confidence: cause.confidence,
                });
            }
            named.insert(effect);
        }
        self.named = named;
        if report.unknown.flagged && !self.had_rest {
            out.push(Output::NewRest {
                covariate: report.unknown.description.covariate.clone(),
            });
        }
        self.had_rest = report.unknown.flagged;
    }
}

fn size(cause: &Cause) -> String {
    let parameters = cause.parameters.iter();
    let words = parameters.map(|p| {
        format!(
            "{} = {:.2} ({:.2} to {:.2})",
            p.name, p.value, p.low, p.high
        )
    });
    words.collect::<Vec<_>>().join(", ")
}

/// The report as it is published.
#[must_use]
pub fn summary(at: Stamp<Host>, runs: Vec<u32>, report: &GapReport) -> GapSummary {
    let mm = |um: f64| um * 1e-3;
    let or_nan = |um: Option<f64>| um.map_or(f64::NAN, mm);
    GapSummary {
        at,
        runs,
        rms_mm: mm(report.gap.rms_um),
        p95_mm: mm(report.gap.p95_um),
        floor_mm: mm(report.gap.floor_um),
        above_floor: report.gap.above_floor,
        causes: report.causes.iter().map(cause).collect(),
        has_unknown: report.unknown.flagged,
        unknown_covariate: report.unknown.description.covariate.clone(),
        held_out_runs: report.shrink.held_out_runs.clone(),
        rms_before_mm: or_nan(report.shrink.rms_um.before),
        rms_after_mm: or_nan(report.shrink.rms_um.after),
        gap_closed: report
            .shrink
            .gap_closed
            .map_or(f64::NAN, |closed| closed.value),
        next_experiment: report
            .next_experiments
            .first()
            .map_or_else(String::new, |next| next.run.clone()),
        json: serde_json::to_string(report)
            .expect("a report has no map with keys that are no text"),
    }
}

fn cause(cause: &Cause) -> GapCause {
    let parameters = cause.parameters.iter().map(|p| GapParameter {
        name: p.name.clone(),
        value: p.value,
        low: p.low,
        high: p.high,
    });
    GapCause {
        effect: cause.effect.clone(),
        axis: cause.axis.clone(),
        status: match cause.status {
            Status::Named => GapStatus::Named,
            Status::Surrogate => GapStatus::Surrogate,
            Status::Set => GapStatus::Set,
        },
        confidence: cause.confidence,
        whitened_size: cause.d,
        parameters: parameters.collect(),
    }
}

impl Stage for GapDiagnosisStage {
    type Input = Input;
    type Output = Output;
    type Error = GapError;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), GapError> {
        match input {
            Input::Sample(sample) => self.sample(sample),
            Input::Tick => self.look(at, out),
        }
        Ok(())
    }
}
