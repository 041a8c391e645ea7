//! From a recorded session and a machine file to the report and what the pages draw.

use std::collections::{BTreeMap, BTreeSet};

use machine::MachineFile;
use machine::file::EffectEntry;
use twin::effects::{self, CATALOGUE, Effect, Kind, Moment};
use twin::{Channel, Session, Twin, simulate};

use crate::config::GapConfig;
use crate::error::GapError;
use crate::experiment::Experiment;
use crate::judgement::along;
use crate::judgement::by_thermometer;
use crate::judgement::cause::Found;
use crate::judgement::guard;
use crate::judgement::unknown::Leftover;
use crate::judgement::{Check, CheckId};
use crate::judgement::{recalibration, unknown};
use crate::next::{self, Bench};
use crate::noise::form_error::FormError;
use crate::noise::stack::Stack;
use crate::noise::unrepeated;
use crate::noise::whiteness;
use crate::noise::{self, Noise, Readings};
use crate::report::figures::{Figures, Note};
use crate::report::{DoesNotRepeat, Gap, GapReport, NotExcited, OverSession, SCHEMA};
use crate::report::{floor, follows, localise, places};
use crate::search::families::Slot;
use crate::search::isolability;
use crate::search::regression::Regression;
use crate::search::rows::Rows;
use crate::search::searched::{Base, Searched, less, told};
use crate::session::changes::{self, Change, moved};
use crate::session::fewer::{MIN_STATIONS_KEPT, fewer};
use crate::session::log;
use crate::session::over_session;
use crate::session::thermal_floats::ThermalFloat;
use crate::shrink::gap;
use crate::shrink::share_interval;
use crate::shrink::split::{self, Split};
use crate::shrink::{self, Named, Shrunk};

/// Fewer held-out runs than this are to be looked at one by one.
const FEW_HELD_OUT: usize = 6;
/// A gap of so many times the noise is unknown where nothing explains it, whatever the repeats' noise is worth.
const LEAST_UNKNOWN: f64 = 2.0;

/// What the rms of the held-out runs may be with an effect over what it is without: noise alone changes it by this much.
const MOST_RATIO: f64 = 1.02;

/// A diagnosis: the report, what is drawn beside it, and what `--write-machine` adds.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The report; what was read (`inputs`) and `runtime_s` are filled in by whoever has files and a clock.
    pub report: GapReport,
    /// What the pages draw.
    pub figures: Figures,
    /// What a reader should know besides.
    pub notes: Vec<Note>,
    /// The effects that stand alone, as the machine file lists effects; what others could stand for is not in it.
    pub effects: Vec<EffectEntry>,
    /// The report's next experiments, as they would be run.
    pub experiments: Vec<Experiment>,
}

/// Diagnoses a session.
///
/// # Errors
/// Where nothing was read or nothing was repeated, and for a session or machine file that cannot be simulated.
pub fn diagnose(
    machine: &MachineFile,
    session: &Session,
    config: &GapConfig,
) -> Result<Diagnosis, GapError> {
    diagnose_against(machine, session, session, config)
}

/// Diagnoses a session whose noise is what the repeats of another one of the same machine show.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_against(
    machine: &MachineFile,
    session: &Session,
    quiet: &Session,
    config: &GapConfig,
) -> Result<Diagnosis, GapError> {
    let kinds = considered(config)?;
    // A set-up that seems to move again and again may be a machine that grows.
    let leaves = |grown: &Diagnosis, from_run: u32| {
        let left = &grown.report.does_not_repeat;
        left.iter().any(|own| own.from_run == from_run)
    };
    prepared(machine, [session, quiet], config, leaves, |base, notes| {
        base.diagnosis(&kinds, config, notes)
    })
}

/// The signatures of the catalogue on the runs that a diagnosis is fitted to, before it has found anything.
pub(crate) fn signatures(
    machine: &MachineFile,
    session: &Session,
    config: &GapConfig,
) -> Result<Regression, GapError> {
    first_stack(machine, session, config, |stack, kinds| {
        Regression::new(stack, kinds)
    })
}

/// Goes on with the runs that a diagnosis is fitted to, as they are stacked for its first search, and the kinds of it.
pub(crate) fn first_stack<R>(
    machine: &MachineFile,
    session: &Session,
    config: &GapConfig,
    then: impl Fn(&Stack<'_>, &[&'static Kind]) -> R,
) -> Result<R, GapError> {
    let kinds = considered(config)?;
    prepared(
        machine,
        [session; 2],
        config,
        |_, _| true,
        |base, _| {
            let split = split::split(base.session, config.hold_out);
            let stack = base.stack(&split.fit, base.noise, &FormError::base(config));
            then(&stack, &kinds)
        },
    )
}

/// Takes the residuals and their noise, and goes on with them. Where a set-up or what is touched seems to move, it is taken for
/// one that stands first; what comes of that holds if it `leaves` no change from such a run on.
fn prepared<R>(
    machine: &MachineFile,
    [session, quiet]: [&Session; 2],
    config: &GapConfig,
    leaves: impl Fn(&R, u32) -> bool,
    then: impl Fn(&Base<'_>, Vec<Note>) -> R,
) -> Result<R, GapError> {
    config.check()?;
    simulate::check(session)?;
    let of = session.runs.len();
    let own_noise = std::ptr::eq(session, quiet);
    let chosen = fewer(session, config);
    let session = chosen.as_ref().unwrap_or(session);
    let of_quiet = (!own_noise).then(|| fewer(quiet, config)).flatten();
    let quiet = of_quiet.as_ref().unwrap_or(quiet);
    let twin = Twin::new(machine)?;
    let residual = residuals(machine, &twin, session)?;
    let all = (0..session.runs.len()).collect::<Vec<_>>();
    let stations = stations(session, &all, config);
    let rows = Rows::new(session, &all, stations, |_| true);
    if rows.len == 0 {
        return Err(GapError::NoReadings);
    }
    let of_session = own_noise.then(|| changes_of(session, &rows, &residual, config));
    let changes = of_session.unwrap_or_default();
    let set_ups = changes::set_ups(session);
    let of_set_up = |session: &Session, moved: &[&Change]| -> Result<R, GapError> {
        let noise = if own_noise {
            noise_of(machine, session, stations, &residual, &changes, config)
        } else {
            simulate::check(quiet)?;
            let residual = residuals(machine, &twin, quiet)?;
            noise_of(machine, quiet, stations, &residual, &[], config)
        };
        if noise.is_empty() {
            return Err(no_repeats(session, &rows));
        }
        let base = Base {
            machine,
            session,
            twin: &twin,
            stations,
            noise: &noise,
            residual: &residual,
            listed: listed(machine)?,
            begins: changes::begins(session, &changes),
            changes: changes.clone(),
            set_ups: set_ups.clone(),
            floats: vec![],
            moved: moved::of(session, moved.iter().copied()),
            is_of_targets: false,
        };
        let base = base.floating(config);
        Ok(then(&base, of_begin(&base, &rows, of)))
    };
    let anew = changes::set_up_anew(session, &changes, config);
    let is_left = |of: &R, change: &Change| {
        let first = &session.runs[change.between[1]];
        leaves(of, first.segment.run)
    };
    moved::standing_first((session, anew.as_ref()), &changes, of_set_up, is_left)
}

/// What a reader should know before anything is searched; `of` runs were recorded.
fn of_begin(base: &Base<'_>, rows: &Rows, of: usize) -> Vec<Note> {
    let session = base.session;
    let mut notes = notes(rows, base.noise);
    notes.extend(base.floats.iter().map(ThermalFloat::note));
    if session.history.temperature_degc.is_empty() && !base.machine.temperature_sensors.is_empty() {
        notes.push(Note::NoTemperatures);
    }
    if session.runs.len() < of {
        let runs = session.runs.len();
        notes.push(Note::FewerRuns { runs, of });
    }
    notes
}

/// What changed between the repeats of a session.
fn changes_of(
    session: &Session,
    rows: &Rows,
    residual: &[Vec<f64>],
    config: &GapConfig,
) -> Vec<Change> {
    let mut raw = vec![0.0; rows.len];
    for (run, residual) in residual.iter().enumerate() {
        rows.average(run, residual, &mut raw);
    }
    changes::find(session, rows, &raw, config)
}

/// Noise of the repeats of a session, but for what changed at some of its runs.
fn noise_of(
    machine: &MachineFile,
    session: &Session,
    stations: usize,
    residual: &[Vec<f64>],
    changes: &[Change],
    config: &GapConfig,
) -> BTreeMap<Channel, Noise> {
    let all: Vec<usize> = (0..session.runs.len()).collect();
    let rows = Rows::new(session, &all, stations, |_| true);
    let mut raw = vec![0.0; rows.len];
    for &run in &all {
        rows.average(run, &residual[run], &mut raw);
    }
    let readings = Readings {
        machine,
        session,
        rows: &rows,
        residual,
    };
    let steps: Vec<usize> = changes.iter().map(|change| change.between[1]).collect();
    noise::noise(readings, &raw, &steps, config)
}

impl<'a> Base<'a> {
    fn bench(&self, config: &GapConfig) -> Bench<'_> {
        Bench {
            machine: self.machine,
            session: self.session,
            twin: self.twin,
            noise: self.noise,
            form: FormError::base(config),
        }
    }

    fn diagnosis(
        &self,
        kinds: &[&'static Kind],
        config: &GapConfig,
        mut notes: Vec<Note>,
    ) -> Diagnosis {
        let split = split::split(self.session, config.hold_out);
        let (searched, mut scattered) = self.explained(&split, kinds, config);
        if searched.found.leftover.flagged() && scattered.is_named() {
            scattered.check_within(&self.scattered_within(&searched, kinds, config));
        }
        let Searched {
            stack,
            slots,
            before,
            mut found,
            inflation,
            ..
        } = searched;
        let has_repeats = !(unrepeated::is_assumed(self.noise) && log::is_of_logs(&stack));
        let noise_check = guard::judge(&inflation, config, has_repeats, &mut notes);
        found.add_check(&noise_check);
        scattered.add_check(&noise_check);
        notes.extend(remarks(&stack, &split, &found));
        let next = next::propose(&self.bench(config), &found);
        notes.extend(next.notes);
        let all = self.stack(&split.all(), self.noise, &FormError::base(config));
        let shrunk = self.confirmed(&all, &stack, &split, &mut found, before.flagged(), config);
        let sizes = gap::by_block(&all, self.noise, &all.floated(all.raw.clone()), &all.runs);
        let floated = stack.floated(stack.raw.clone());
        let (rest, beside) = self.beside_named(&stack, &slots, &found, config);
        let (over_session, does_not_repeat) =
            self.over_session(&stack, &all, &found, &rest, config);
        notes.extend(over_session::notes(&over_session, &does_not_repeat));
        let remainder = over_session::remainder(&mut found, &shrunk, before.flagged(), config);
        let is_left = remainder.is_some();
        notes.extend(remainder);
        // What came after the runs that are fitted is a gap that these do not show.
        let is_late = is_left && !before.flagged();
        let gap = gap::table(&all, &sizes, before.flagged() || is_late);
        let stands_out = stands_out(&gap, !noise_check.has_failed());
        let flagged = stands_out && before.flagged() && (beside.flagged() || is_left);
        let effects = [found.entries(), scattered.entries()];
        let of = ([&stack, &all], [&before, &beside]);
        let figures = figures(of, &slots, &found, &shrunk, config);
        let report = GapReport {
            schema: SCHEMA.to_owned(),
            noise_floor: floor::of(self, &inflation, config),
            gap,
            r#where: places::places(&stack, &slots, &before.families, &floated),
            causes: [found.causes(), scattered.causes].concat(),
            unknown: unknown::unknown(&stack, &slots, &beside, (flagged, is_late), &rest),
            shrink: shrunk.shrink,
            not_excited: not_excited(&found, &scattered.seen, kinds),
            next_experiments: next.entries,
            over_session,
            does_not_repeat,
            follows: follows::of(&found),
            ..GapReport::default()
        };
        Diagnosis {
            report,
            figures,
            notes: follows::with_sign(notes, &stack, &found),
            effects: effects.concat(),
            experiments: next.experiments,
        }
    }

    /// Whether the named effects, which leave `rest` of what was fitted, hold over the session, and what no effect explains of its changes.
    fn over_session(
        &self,
        fitted: &Stack<'_>,
        all: &Stack<'_>,
        found: &Found,
        rest: &[f64],
        config: &GapConfig,
    ) -> (Vec<OverSession>, Vec<DoesNotRepeat>) {
        let over_session = over_session::of_named(fitted, found, rest, config);
        let left = less(&all.raw, &told(all, found.named(), found));
        let changes =
            over_session::not_repeated(all, &left, (&self.changes, &self.set_ups), found, config);
        (over_session, changes)
    }

    /// What the named effects leave, before whitening, and its scores.
    fn beside_named(
        &self,
        stack: &Stack<'_>,
        slots: &[Slot],
        found: &Found,
        config: &GapConfig,
    ) -> (Vec<f64>, Leftover) {
        let rest = less(&stack.raw, &told(stack, found.named(), found));
        let white = stack.whitened(rest.clone());
        let leftover = unknown::leftover(stack, slots, self.noise, &white, &[], config);
        (rest, leftover)
    }

    /// How far the gap shrinks with what is named, after what makes the held-out runs worse has been withdrawn, the worst first.
    fn confirmed(
        &self,
        all: &Stack<'_>,
        fitted: &Stack<'_>,
        split: &Split,
        found: &mut Found,
        has_gap: bool,
        config: &GapConfig,
    ) -> Shrunk {
        loop {
            let shrunk = self.shrunk(all, split, found, has_gap, config);
            let ratios = shrunk.held_out_ratios();
            let worst = ratios.iter().copied().enumerate();
            let worst = worst.max_by(|a, b| a.1.total_cmp(&b.1));
            let check = |ratio: f64| {
                Check::new(CheckId::HeldOutRms, ratio <= MOST_RATIO).with(ratio, MOST_RATIO)
            };
            match worst.filter(|(_, ratio)| *ratio > MOST_RATIO) {
                Some((named, ratio)) => found.check_named(fitted, named, check(ratio)),
                None => {
                    for (named, ratio) in ratios.into_iter().enumerate() {
                        found.check_named(fitted, named, check(ratio));
                    }
                    return shrunk;
                }
            }
        }
    }

    fn shrunk(
        &self,
        all: &Stack<'_>,
        split: &Split,
        found: &Found,
        has_gap: bool,
        config: &GapConfig,
    ) -> Shrunk {
        let effects: Vec<Box<dyn Effect>> = found
            .named()
            .map(|member| found.instance(member).effect(&member.estimate.values))
            .collect();
        let named: Vec<Named<'_>> = found
            .named()
            .zip(&effects)
            .map(|(member, effect)| Named {
                effect: found.instance(member).kind.id.to_owned(),
                axis: found.instance(member).target.to_string(),
                simulated: &**effect,
            })
            .collect();
        shrink::shrink(all, self.noise, split, &named, has_gap, config)
    }
}

/// What the pages draw, of the runs that were fitted and of all; `scores` are those of the residual before and beside what is named.
fn figures(
    ([stack, all], scores): ([&Stack<'_>; 2], [&Leftover; 2]),
    slots: &[Slot],
    found: &Found,
    shrunk: &Shrunk,
    config: &GapConfig,
) -> Figures {
    let [before, beside] = scores.map(|score| &score.families);
    Figures {
        heat: places::heat_map(slots, before, beside),
        traces: shrunk.traces.clone(),
        isolability: isolability::isolability(
            &found.signatures,
            &found.normal,
            &found.forms,
            stack.freedom(),
        ),
        held_out: shrunk.held_out.clone(),
        apart: shrunk.apart.clone(),
        share_intervals: share_interval::of_places(stack, slots, before, config),
        drifts: follows::drifts(all, found),
    }
}

/// What a reader should know of the runs and of what is left of them.
fn remarks(stack: &Stack<'_>, split: &Split, found: &Found) -> Vec<Note> {
    let mut notes = Vec::new();
    match split.held_out.len() {
        0 => notes.push(Note::NothingHeldOut),
        runs if runs < FEW_HELD_OUT => notes.push(Note::FewHeldOut { runs }),
        _ => {}
    }
    if stack.runs.len() < localise::MIN_RUNS_TO_LOCALISE {
        notes.push(Note::FewRuns {
            runs: stack.runs.len(),
        });
    }
    let coloured = whiteness::coloured(stack, &found.left);
    notes.extend(coloured.into_iter().map(|found| Note::NotWhite {
        channel: found.channel,
        blocks: found.blocks,
        of: found.of,
    }));
    notes.extend(found.not_written());
    notes.extend(found.only_together());
    notes.extend(along::notes(stack, found));
    notes.extend(found.not_named());
    if !found.members.is_empty() && recalibration::PROVENANCE.is_none() {
        notes.push(Note::NotRecalibrated);
    }
    notes
}

fn no_repeats(session: &Session, rows: &Rows) -> GapError {
    let channels: BTreeSet<String> = rows
        .blocks
        .iter()
        .map(|block| block.channel.to_string())
        .collect();
    GapError::NoRepeats {
        runs: session.runs.len(),
        channels: channels.into_iter().collect::<Vec<_>>().join(", "),
    }
}

/// The kinds of the catalogue that are considered.
pub(crate) fn considered(config: &GapConfig) -> Result<Vec<&'static Kind>, GapError> {
    if let Some(id) = config
        .left_out
        .iter()
        .find(|id| effects::kind(id).is_none())
    {
        return Err(GapError::LeftOut { id: id.clone() });
    }
    // Logs ask for what goes with a thermometer (`by_thermometer`), and drifts that a temperature explains better (`by_clock`).
    let kept = |kind: &&&'static Kind| {
        kind.id != by_thermometer::SHIFT && config.left_out.iter().all(|id| id != kind.id)
    };
    Ok(CATALOGUE.iter().filter(kept).copied().collect())
}

/// Reading minus what the machine file predicts, for every reading of every run.
fn residuals(
    machine: &MachineFile,
    twin: &Twin<'_>,
    session: &Session,
) -> Result<Vec<Vec<f64>>, GapError> {
    let known = effects::known(machine)?;
    let known: Vec<&dyn Effect> = known.iter().map(|effect| &**effect).collect();
    let of_run = |run| {
        let predicted = twin.predict(session, run, &known);
        let readings = run.readings.iter().zip(predicted);
        readings
            .map(|(reading, sim)| reading.deviation - sim)
            .collect()
    };
    Ok(session.runs.iter().map(of_run).collect())
}

/// The effects that a machine file lists, its nominal loops not among them.
fn listed(machine: &MachineFile) -> Result<Vec<Box<dyn Effect>>, GapError> {
    let entries = machine.effects.iter().enumerate();
    let effects = entries.map(|(index, entry)| effects::from_entry(machine, index, entry));
    Ok(effects.collect::<Result<_, _>>()?)
}

/// Stations a circle or pass, fewer where the session would have too many rows.
pub(crate) fn stations(session: &Session, runs: &[usize], config: &GapConfig) -> usize {
    let mut stations = config.stations;
    while stations > MIN_STATIONS_KEPT
        && Rows::new(session, runs, stations, |_| true).len > config.most_rows
    {
        stations = stations * 3 / 4;
    }
    stations
}

fn notes(rows: &Rows, noise: &BTreeMap<Channel, Noise>) -> Vec<Note> {
    let mut dropped = BTreeMap::<&Channel, usize>::new();
    for block in &rows.blocks {
        *dropped.entry(&block.channel).or_default() += block.dropped;
    }
    let mut notes = Vec::new();
    for (channel, readings) in dropped {
        if readings > 0 {
            notes.push(Note::Dropped {
                channel: channel.to_string(),
                readings,
            });
        }
        if !noise.contains_key(channel) {
            notes.push(Note::NoRepeats {
                channel: channel.to_string(),
            });
        }
    }
    notes
}

/// Whether a gap may be unknown: what is much larger than noise is no noise, also where the floor is not that of the repeats;
/// nothing is named then.
fn stands_out(gap: &Gap, reproduced: bool) -> bool {
    reproduced || gap.rms_um >= LEAST_UNKNOWN * gap.floor_um
}

/// Kinds of which no instance could be seen.
fn not_excited(found: &Found, scattering: &[&str], kinds: &[&'static Kind]) -> Vec<NotExcited> {
    let seen = |kind: &&&'static Kind| {
        let all = found
            .signatures
            .instances
            .iter()
            .zip(&found.signatures.excited);
        scattering.contains(&kind.id)
            || all
                .into_iter()
                .any(|(instance, seen)| *seen && instance.kind.id == kind.id)
    };
    let entry = |kind: &&'static Kind| NotExcited {
        effect: kind.id.to_owned(),
        needs: match kind.moment {
            Moment::Mean => kind.needs.to_owned(),
            // What scatters alike everywhere is the noise floor itself.
            Moment::Variance => format!("{}, under conditions that it differs with", kind.needs),
        },
    };
    kinds.iter().filter(|kind| !seen(kind)).map(entry).collect()
}
