//! The node's whole computation: samples in, a diagnosis of the last runs out.
//!
//! After each segment that was recorded whole, and at most every `least_period_s`, the last runs are diagnosed as a
//! bag of them would be. An effect that was never named before, or not at that size, is told of by itself.
//!
//! Once the runs before the last test cycle have repeated its tests three times, the last cycle is what is diagnosed,
//! and the runs before it say what noise is: a machine that changes between two cycles would else have its change taken
//! for noise. When what is named changes, the runs before the change no longer say what noise is; until the runs since
//! then are repeats enough, the noise from before is kept. Until there are enough of any, all runs are diagnosed by
//! their own repeats.
//!
//! A cycle alone does not show what takes hours, as a screw that warms. So all runs are diagnosed as well, as
//! `abbe diagnose` would a bag of them, and that report is published. The cycle's own is published where it names an
//! effect at another size, and for one more cycle where it names one that all runs do not show yet.
//!
//! An effect is told of when it is named and stands well above what can be seen; one that sets in at an instant only where
//! runs from before say what noise is: else a few runs after any change of the machine look like one. A rest that no effect explains is vaguer: it is told of when a whole cycle
//! later it is still there.
//!
//! A diagnosis takes a second or two. In simulated time it is made at once, so that equal samples give equal reports.
//! On a live machine it is made beside ([`GapDiagnosisStage::go_beside`]): the stage gives a [`Task`] out, takes samples
//! while somebody runs it, and is told its [`Finding`]; a new one begins only when the one before is back.

use std::collections::{BTreeMap, BTreeSet};

use machine::MachineFile;
use metrology::sample::GapSummary;
use metrology::stamp::Span;
use metrology::{Host, Stage, Stamp};
use twin::{Run, Session};

use crate::config::GapConfig;
use crate::diagnose::diagnose_against;
use crate::error::GapError;
use crate::following::GapDiagnosisConfig;
use crate::noise::repeats::same_condition;
use crate::report::{Cause, GapReport, Status};
use crate::search::signature::INSTANT;
use crate::session::{self, SessionBuilder, SessionConfig, SessionError};

mod told;

pub use told::summary;
use told::{interval, is_same, named, new_effect, sizes_meet};

/// What the node is told.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "nearly every input is a sample, and a box would be an allocation at every servo tick"
)]
pub enum Input {
    /// A recorded sample.
    Sample(session::Input),
    /// A diagnosis that was given out is made.
    Found(Box<Finding>),
    /// Time passes.
    Tick,
}

/// A diagnosis to be made.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    machine: MachineFile,
    session: Session,
    /// The session whose repeats say what noise is, where it is another one.
    quiet: Option<Session>,
    /// All runs, where `session` has the last cycle alone.
    whole: Option<Session>,
    gap: GapConfig,
    /// Runs that were closed up to the last that is diagnosed.
    closed: usize,
}

/// What was found of some runs.
#[derive(Clone, Debug, PartialEq)]
struct OfRuns {
    runs: Vec<u32>,
    outcome: Result<GapReport, GapError>,
}

/// A diagnosis that was made.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Of the last cycle, or of all runs where nothing else says what noise is.
    cycle: OfRuns,
    /// Of all runs, where the above is of the last cycle.
    whole: Option<OfRuns>,
    quiet: Option<Session>,
    closed: usize,
}

impl Task {
    /// Makes the diagnosis.
    #[must_use]
    pub fn run(self) -> Finding {
        let of = |session: &Session, quiet: &Session| OfRuns {
            runs: session.runs.iter().map(|run| run.segment.run).collect(),
            outcome: diagnose_against(&self.machine, session, quiet, &self.gap)
                .map(|found| found.report),
        };
        Finding {
            cycle: of(&self.session, self.quiet.as_ref().unwrap_or(&self.session)),
            whole: self.whole.as_ref().map(|whole| of(whole, whole)),
            closed: self.closed,
            quiet: self.quiet,
        }
    }
}

/// D from which an effect is found in every diagnosis. One nearer to what can be seen at all (about 8) is named in one and
/// not in the next: that is no change of the machine.
const MIN_D_OF_CHANGE: f64 = 10.0;
/// Where so many ticks follow one another without a word from the controller, what has ended is whole. They are counted
/// and not timed, for samples may wait in a process that was stopped for a while.
const SILENT_TICKS: u32 = 3;
/// Repeats of a test that say what its noise is.
const REPEATS: usize = 3;

/// Whether earlier runs repeat the tests of a cycle often enough; touches are repeated within their runs.
fn is_repeated(cycle: &[Run], earlier: &[Run]) -> bool {
    let is_known = |run: &Run| {
        let same = earlier.iter().filter(|one| same_condition(one, run));
        same.count() >= REPEATS
    };
    let paths = || cycle.iter().filter(|run| run.touches.is_empty());
    let known = paths().filter(|run| is_known(run)).count();
    !earlier.is_empty() && 2 * known >= paths().count()
}

/// What the node says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// A diagnosis is to be made beside.
    Due(Box<Task>),
    /// A diagnosis.
    Report(Box<GapSummary>),
    /// An effect that was not told of before, or not at this size: its id, what it acts on, its size in words.
    NewEffect {
        /// Id and what it acts on.
        effect: String,
        /// What these runs cannot tell from it, in words behind its name.
        besides: String,
        /// Parameters with their values.
        size: String,
        /// Probability.
        confidence: f64,
    },
    /// A rest that no effect explains and that stays, where there was none before.
    NewRest {
        /// What it goes with.
        covariate: String,
    },
    /// No diagnosis can be made of the last runs, and why.
    NotYet(GapError),
    /// An axis state was of another machine: it is left out. Reported with the first of them.
    OtherMachine(SessionError),
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
    /// Ticks since the last word from the controller.
    silent_ticks: u32,
    is_due: bool,
    /// Whether diagnoses are given out, and whether one is on its way.
    beside: bool,
    is_out: bool,
    /// Runs that were closed before the machine became what it is now.
    steady_from: usize,
    /// The last session whose repeats said what noise is.
    quiet: Option<Session>,
    named: BTreeSet<String>,
    /// Effects that were told of, with the interval of their first parameter then.
    told: BTreeMap<String, [f64; 2]>,
    /// Runs that were closed when the last cycle first named what all runs do not.
    ahead_since: Option<usize>,
    /// Runs that were closed when the rest that is there was first seen.
    rest_since: Option<usize>,
    had_rest: bool,
    remarks: Vec<String>,
    has_begun_anew: bool,
    has_met_another: bool,
}

impl GapDiagnosisStage {
    /// From parameters and machine file.
    ///
    /// # Errors
    /// Parameters out of range, a chain that cannot be read, known effects that the catalogue does not have.
    pub fn new(config: &GapDiagnosisConfig, machine: &MachineFile) -> Result<Self, GapError> {
        twin::effects::known(machine)?;
        Ok(Self {
            gap: config.gap_config()?,
            builder: SessionBuilder::new(machine, SessionConfig::default())?,
            config: config.clone(),
            machine: machine.clone(),
            last: None,
            silent_ticks: 0,
            is_due: false,
            beside: false,
            is_out: false,
            steady_from: 0,
            quiet: None,
            named: BTreeSet::new(),
            told: BTreeMap::new(),
            ahead_since: None,
            rest_since: None,
            had_rest: false,
            remarks: vec![],
            has_begun_anew: false,
            has_met_another: false,
        })
    }

    /// From now on diagnoses are given out rather than made at once.
    pub fn go_beside(&mut self) {
        self.beside = true;
    }

    fn sample(&mut self, sample: session::Input) {
        use session::Input::{Segment, State, Trigger};
        if matches!(sample, State(_) | Trigger(_) | Segment(_)) {
            self.silent_ticks = 0;
        }
        self.gather(|builder| builder.take(sample));
    }

    fn first_of_another(&mut self) -> Option<Output> {
        let error = self.builder.other_machine()?;
        let is_first = !std::mem::replace(&mut self.has_met_another, true);
        is_first.then(|| Output::OtherMachine(error.clone()))
    }

    /// The last run of a recording that is played closes when no more comes.
    fn settle(&mut self) {
        self.silent_ticks = self.silent_ticks.saturating_add(1);
        if self.silent_ticks == SILENT_TICKS {
            self.gather(SessionBuilder::settle);
        }
    }

    fn gather(&mut self, how: impl FnOnce(&mut SessionBuilder)) {
        if self.builder.is_over() {
            self.begin_anew();
        }
        let closed = self.builder.closed();
        how(&mut self.builder);
        if self.builder.closed() > closed {
            self.builder.keep_last(self.config.last_runs);
            self.is_due |= self.builder.runs().len() >= self.config.least_runs;
        }
    }

    /// A session that became longer than what is held of its past ends, and another one begins with what comes next.
    fn begin_anew(&mut self) {
        // The same machine was taken at the start.
        if let Ok(builder) = SessionBuilder::new(&self.machine, SessionConfig::default()) {
            self.builder = builder;
            self.steady_from = 0;
            self.quiet = None;
            self.ahead_since = None;
            self.rest_since = None;
            self.has_begun_anew = true;
        }
    }

    fn look(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let period = Span::from_secs_f64(self.config.least_period_s);
        let rested = self
            .last
            .is_none_or(|last| at - last >= period || at < last);
        if !(self.is_due && rested) || self.is_out {
            return;
        }
        self.is_due = false;
        self.last = Some(at);
        let task = self.task();
        if self.beside {
            self.is_out = true;
            out.push(Output::Due(Box::new(task)));
        } else {
            self.found(at, task.run(), out);
        }
    }

    /// The last cycle, and what says its noise; all runs where nothing does.
    fn task(&self) -> Task {
        let mut session = self.builder.so_far();
        let earlier = session.runs.len().saturating_sub(self.config.cycle_runs);
        let held = self.builder.closed() - session.runs.len();
        let steady = self.steady_from.saturating_sub(held).min(earlier);
        let (before, cycle) = session.runs.split_at(earlier);
        let steadily = before.get(steady..).unwrap_or(&[]);
        let quiet = if is_repeated(cycle, steadily) {
            let history = session.history.clone();
            let runs = steadily.to_vec();
            Some(Session {
                history,
                runs,
                first_bag_ends: None,
            })
        } else {
            self.quiet.clone()
        };
        let mut whole = None;
        if quiet.is_some() && earlier > 0 {
            whole = Some(session.clone());
            session.runs.drain(..earlier);
        }
        Task {
            machine: self.machine.clone(),
            session,
            quiet,
            whole,
            gap: self.gap.clone(),
            closed: self.builder.closed(),
        }
    }

    fn found(&mut self, at: Stamp<Host>, finding: Finding, out: &mut Vec<Output>) {
        self.is_out = false;
        let (closed, is_known) = (finding.closed, finding.quiet.is_some());
        let cycle = finding.cycle.outcome.as_ref().ok().cloned();
        let told = self.told_of(finding.cycle, finding.whole, closed);
        match told.outcome {
            Ok(report) => {
                out.push(Output::Report(Box::new(summary(at, told.runs, &report))));
                if let Some(cycle) = &cycle {
                    self.tell_of_cycle(cycle, is_known, closed, out);
                }
                self.tell_first(&report, is_known, out);
                self.look_at_rest(closed, &report, out);
                if let Some(quiet) = finding.quiet {
                    self.quiet = Some(quiet);
                }
            }
            Err(error) => out.push(Output::NotYet(error)),
        }
        self.tell_left_out(out);
    }

    /// The report that is published: of all runs, or of the last cycle where that names an effect at another size, or, for one
    /// more cycle, an effect that all runs do not show yet.
    fn told_of(&mut self, cycle: OfRuns, whole: Option<OfRuns>, closed: usize) -> OfRuns {
        let Some(whole) = whole else {
            return cycle;
        };
        let (Ok(of_cycle), Ok(of_all)) = (&cycle.outcome, &whole.outcome) else {
            return if whole.outcome.is_ok() { whole } else { cycle };
        };
        let named = |report: &'_ GapReport| -> Vec<Cause> {
            let causes = report.causes.iter();
            let named = causes.filter(|cause| cause.status == Status::Named);
            named.cloned().collect()
        };
        let (now, all) = (named(of_cycle), named(of_all));
        let in_all = |cause: &Cause| all.iter().find(|other| is_same(other, cause));
        if now.iter().all(|cause| in_all(cause).is_some()) {
            self.ahead_since = None;
            let has_size =
                |cause: &Cause| in_all(cause).is_some_and(|other| sizes_meet(other, cause));
            return if now.iter().all(has_size) {
                whole
            } else {
                cycle
            };
        }
        let since = *self.ahead_since.get_or_insert(closed);
        if closed >= since + self.config.cycle_runs {
            whole
        } else {
            cycle
        }
    }

    fn tell_left_out(&mut self, out: &mut Vec<Output>) {
        let remarks: Vec<String> = self.builder.account().remarks().collect();
        if remarks != self.remarks {
            self.remarks.clone_from(&remarks);
            out.push(Output::LeftOut(remarks));
        }
    }

    /// What is sure and new of the last cycle; `is_known` where runs from before say what noise is.
    fn tell_of_cycle(
        &mut self,
        report: &GapReport,
        is_known: bool,
        closed: usize,
        out: &mut Vec<Output>,
    ) {
        let sure = { report.causes.iter() }.filter(|cause| self.is_sure(cause, is_known));
        let sure: Vec<&Cause> = sure.collect();
        for cause in &sure {
            if self.is_news(cause) {
                out.push(new_effect(cause));
            }
        }
        let named: BTreeSet<String> = sure.into_iter().map(named).collect();
        if named != self.named {
            self.named = named;
            // Those that were looked at may be of before and after.
            self.steady_from = closed;
        }
    }

    /// What is sure of all runs and was never told of.
    fn tell_first(&mut self, report: &GapReport, is_known: bool, out: &mut Vec<Output>) {
        for cause in &report.causes {
            let is_first = !self.told.contains_key(&named(cause));
            if is_first && self.is_sure(cause, is_known) && self.is_news(cause) {
                out.push(new_effect(cause));
            }
        }
    }

    /// Whether a cause stands well above what can be seen.
    fn is_sure(&self, cause: &Cause, is_known: bool) -> bool {
        cause.status != Status::Surrogate
            && cause.confidence >= self.config.least_confidence
            && cause.d >= MIN_D_OF_CHANGE
            && (is_known || cause.parameters.iter().all(|p| p.name != INSTANT))
    }

    /// Whether an effect was never told of, or has another size than when it was: one at the edge of what can be seen
    /// comes and goes from diagnosis to diagnosis.
    fn is_news(&mut self, cause: &Cause) -> bool {
        let now = interval(cause);
        let effect = named(cause);
        let before = self.told.get(&effect);
        let is_news = before.is_none_or(|[low, high]| now[0] > *high || now[1] < *low);
        if is_news {
            self.told.insert(effect, now);
        }
        is_news
    }

    /// A rest is told of once, when it is there in diagnoses of a whole cycle of new runs.
    fn look_at_rest(&mut self, closed: usize, report: &GapReport, out: &mut Vec<Output>) {
        if !report.unknown.flagged {
            self.rest_since = None;
            self.had_rest = false;
            return;
        }
        let since = *self.rest_since.get_or_insert(closed);
        if closed >= since + self.config.cycle_runs && !self.had_rest {
            self.had_rest = true;
            out.push(Output::NewRest {
                covariate: report.unknown.description.covariate.clone(),
            });
        }
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
            Input::Sample(sample) => {
                self.sample(sample);
                out.extend(self.first_of_another());
                if std::mem::take(&mut self.has_begun_anew) {
                    let remark = "the session was longer than 31 days: it begins anew, without its runs so far";
                    out.push(Output::LeftOut(vec![remark.to_owned()]));
                }
            }
            Input::Found(finding) => self.found(at, *finding, out),
            Input::Tick => {
                self.settle();
                self.look(at, out);
                self.tell_left_out(out);
            }
        }
        Ok(())
    }
}
