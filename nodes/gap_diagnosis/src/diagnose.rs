//! From a recorded session and a machine file to the report and what the pages draw.

use std::collections::{BTreeMap, BTreeSet};

use machine::MachineFile;
use machine::effects::{self, CATALOGUE, Effect, Kind, Moment};
use machine::file::EffectEntry;
use machine::twin::{Channel, Session, Twin, simulate};

use crate::cause::{self, Found};
use crate::config::GapConfig;
use crate::error::GapError;
use crate::figures::{Figures, Note};
use crate::gap::{self, Size};
use crate::noise::{self, Noise};
use crate::report::{
    ChannelGap, Gap, GapReport, Inputs, NoiseFloor, NotExcited, SCHEMA, Shrink, Unknown,
};
use crate::rows::Rows;
use crate::stack::Stack;

/// A diagnosis: the report, what is drawn beside it, and what `--write-machine` adds.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The report; what was read (`inputs`) and `runtime_s` are filled in by whoever has files and a clock.
    pub report: GapReport,
    /// What the pages draw.
    pub figures: Figures,
    /// What a reader should know besides.
    pub notes: Vec<Note>,
    /// The named effects, as the machine file lists effects.
    pub effects: Vec<EffectEntry>,
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
    config.check()?;
    simulate::check(session)?;
    let kinds = considered(config)?;
    let twin = Twin::new(machine)?;
    let residual = residuals(machine, &twin, session)?;
    let all = (0..session.runs.len()).collect::<Vec<_>>();
    let stations = stations(session, &all, config);
    let rows = Rows::new(session, &all, stations, |_| true);
    if rows.len == 0 {
        return Err(GapError::NoReadings);
    }
    let mut raw = vec![0.0; rows.len];
    for &run in &all {
        rows.average(run, &residual[run], &mut raw);
    }
    let noise = noise::noise(session, &rows, &raw, config);
    if noise.is_empty() {
        return Err(no_repeats(session, &rows));
    }
    let stack = Stack::new(session, &twin, &all, stations, &noise, &residual);
    let notes = notes(&rows, &noise);
    let found = cause::find(&stack, &kinds, config);
    let sizes = gap::by_block(&stack, &noise, &stack.floated(stack.raw.clone()));
    let report = GapReport {
        schema: SCHEMA.to_owned(),
        inputs: Inputs::default(),
        noise_floor: noise_floor(&noise),
        gap: gap_of(&stack, &sizes, true),
        r#where: vec![],
        causes: found.causes(),
        unknown: Unknown {
            flagged: false,
            score: 0.0,
            threshold: 0.0,
            description: crate::report::Description::default(),
        },
        shrink: Shrink {
            fit_runs: vec![],
            held_out_runs: vec![],
            rms_um: crate::report::BeforeAfter::default(),
            p95_um: crate::report::BeforeAfter::default(),
            gap_closed: None,
            leave_one_out: vec![],
        },
        not_excited: not_excited(&found, &kinds),
        next_experiments: vec![],
        runtime_s: 0.0,
    };
    Ok(Diagnosis {
        report,
        figures: Figures::default(),
        notes,
        effects: found.entries(),
    })
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
fn considered(config: &GapConfig) -> Result<Vec<&'static Kind>, GapError> {
    if let Some(id) = config
        .left_out
        .iter()
        .find(|id| effects::kind(id).is_none())
    {
        return Err(GapError::LeftOut { id: id.clone() });
    }
    let kept = |kind: &&&'static Kind| config.left_out.iter().all(|id| id != kind.id);
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

/// Stations a circle or pass, fewer where the session would have too many rows.
fn stations(session: &Session, runs: &[usize], config: &GapConfig) -> usize {
    let mut stations = config.stations;
    while stations > 32 && Rows::new(session, runs, stations, |_| true).len > config.most_rows {
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

fn noise_floor(noise: &BTreeMap<Channel, Noise>) -> Vec<NoiseFloor> {
    let of = |(channel, noise): (&Channel, &Noise)| NoiseFloor {
        channel: channel.to_string(),
        sigma_um: 1e3 * noise.reading_sigma_mm,
        ar: noise.within.coefficients[noise.within.order()].clone(),
        between_runs_um: 1e3 * noise.between.total_mm(),
        repeats: noise.repeats,
        reproduced: true,
    };
    noise.iter().map(of).collect()
}

fn gap_of(stack: &Stack<'_>, sizes: &[Size], above_floor: bool) -> Gap {
    let whole = gap::together(sizes.iter());
    let channels: BTreeSet<&Channel> = stack
        .rows
        .blocks
        .iter()
        .map(|block| &block.channel)
        .collect();
    let of_channel = |channel: &Channel| {
        let own = stack.rows.blocks.iter().zip(sizes);
        let size = gap::together(
            own.filter(|(b, _)| b.channel == *channel)
                .map(|(_, size)| size),
        );
        ChannelGap {
            channel: channel.to_string(),
            rms_um: size.rms_um(),
            p95_um: size.p95_um(),
            floor_um: size.floor_um(),
            above_floor: above_floor && size.rms_um() > 1.2 * size.floor_um(),
        }
    };
    Gap {
        rms_um: whole.rms_um(),
        p95_um: whole.p95_um(),
        floor_um: whole.floor_um(),
        above_floor,
        per_channel: channels.into_iter().map(of_channel).collect(),
    }
}

/// Kinds of which no instance could be seen.
fn not_excited(found: &Found, kinds: &[&'static Kind]) -> Vec<NotExcited> {
    let seen = |kind: &&&'static Kind| {
        let all = found.library.instances.iter().zip(&found.library.excited);
        !all.into_iter()
            .any(|(instance, seen)| *seen && instance.kind.id == kind.id)
    };
    let entry = |kind: &&'static Kind| NotExcited {
        effect: kind.id.to_owned(),
        needs: kind.needs.to_owned(),
    };
    let means = kinds.iter().filter(|kind| kind.moment == Moment::Mean);
    means.filter(seen).map(entry).collect()
}
