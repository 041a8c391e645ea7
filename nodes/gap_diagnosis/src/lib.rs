//! Where the simulator and the machine differ, which unmodelled effect causes it, and how far the gap
//! shrinks once that effect is added to the simulator.
//!
//! A session is what was commanded and read; `twin` says what should have been read. What is
//! left is looked at against the noise that repeats show, and every question is answered with its doubt. `simulated` puts
//! another simulator in the place of the twin's prediction.
//! `report` is the answer, in the form that people's programs read; `figures` is what pages draw beside it, `follows` the thermometers of logs.
//!
//! `session` makes a session of recorded samples. `rows` thins readings to stations; `repeats` finds what was
//! measured twice, `log` knows runs that stand and are read over time, `field`, `pace` and `noise` make the noise floor of it, `form_error`
//! adds what every simulator is off by; `whitener` makes every row's noise one,
//! `changes` finds what changed between repeats, `nuisance` takes out what set-ups leave open, `stack` keeps both. `signature` asks the twin what each effect of
//! the catalogue would look like, `normal` and `selection` find the set that explains the residual, `widening` gives
//! its effects forms of their own, `refit` sizes
//! it, `form_doubt` says what a size owes to its form, `confirm` tries it on runs left out and under every
//! condition, `challenge` against shapes without a physics; `confidence` weighs its rivals, `recalibration` what a
//! confidence is worth, `veto` what speaks against naming it, `judgement` decides its status from these checks, `cause` puts that together and `searched` says how often. `scatter` looks for effects that move no mean, `whiteness` says whether
//! what is left is white. `families`, `localise` and `places` say where the gap lies, `guard` whether the
//! noise is that of the repeats, `unknown` what no effect explains, `isolability` what could be told from what. `gap` is how much there was to explain, `split` and
//! `shrink` how much of it goes on runs held out, with the intervals of `bootstrap`, `apart` what each effect has of that;
//! `over_session` says whether one size holds over the session; `share_interval` is the interval of a place's share, `unread` the pauses of thermometers; `vibration` what of the noise is a line of its spectrum; `unrepeated` is the noise floor of a log made once, `thermal` finds the thermometers that a log goes with. `experiment` knows what could
//! be measured next and `next` which of it would decide. `diagnose` puts the questions in their order,
//! `preflight` some of them before anything is measured, and `design` chooses what to measure; `regression` is what other methods than these would start
//! from, `problem` the first search as numbers alone, `rule` what of these can be switched off. `stage` is the node's whole computation, `following` its
//! parameters.

pub mod config;
pub mod design;
mod diagnose;
pub mod error;
pub mod experiment;
pub mod following;
pub mod judgement;
mod next;
mod noise;
pub mod preflight;
pub mod report;
mod scatter;
mod search;
pub mod session;
mod shrink;
pub mod simulated;
pub mod stage;

pub use config::GapConfig;
pub use diagnose::{Diagnosis, diagnose};
pub use error::GapError;
pub use following::GapDiagnosisConfig;
pub use judgement::rule;
pub use judgement::rule::Rule;
pub use judgement::veto::Veto;
pub use report::GapReport;
pub use report::figures;
pub use report::figures::{Course, Figures, Note};
pub use search::problem;
pub use search::regression;
pub use search::signature::OWN_TIME;
pub use session::thermal::{GoesWith, ThermalFit};
pub use shrink::closed::MIN_RUNS_CLOSED as LEAST_JUDGED_RUNS;
pub use stage::{GapDiagnosisStage, Input, Output};
