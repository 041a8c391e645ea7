//! What a programme of tests will be able to show, before anything is measured.
//!
//! # Model
//!
//! The programme is given as the session that an ideal machine would record. Its signatures are those of a
//! diagnosis; what no repeat has shown yet is assumed: a floor for each instrument.
//!
//! ```text
//!   size95 = D95 typical / |P W sim(typical)|                             (1)
//!   size told apart = size95 / sin alpha                                  (2)
//! ```
//!
//! The smooth deviation between runs is shared equally by its field over place, its offset and its drift.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | size95 | `found_from` | of the parameter |
//! | sin alpha | `sin_alone` | - |
//!
//! # Holds when
//! The machine moves as the control plans and the floor is what repeats will show. Temperatures are those that the
//! session holds: where they stand still, effects that follow a thermometer show only by the time that passes.
//!
//! # Agreement
//! `eq1_a_backlash_of_the_foreseen_size_has_the_d_that_detects`: a play of the size foreseen, simulated, has D95 to 6 %
//! (6.05 for 5.71): the corners of a play are as wide as itself, so that (1) is not quite proportional.

use std::collections::BTreeMap;

use machine::MachineFile;
use metrology::check_between;
use serde::{Deserialize, Serialize};
use twin::effects::{Kind, Moment};
use twin::{Channel, Instrument, Session, Twin, simulate};

use crate::config::GapConfig;
use crate::diagnose::{considered, stations};
use crate::error::GapError;
use crate::noise::Noise;
use crate::noise::form_error::FormError;
use crate::noise::pace::Pace;
use crate::noise::repeats;
use crate::noise::stack::Stack;
use crate::noise::whitener::Autoregression;
use crate::report::NotExcited;
use crate::report::figures::Isolability;
use crate::search::field::Smooth;
use crate::search::isolability::{self, isolability};
use crate::search::rows::{Rows, count};
use crate::search::signature::{Instance, Library};
use crate::shrink::split;

/// Noise that is assumed of an instrument's readings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AssumedFloor {
    /// Standard deviation of a reading within a run, µm.
    pub reading_um: f64,
    /// Standard deviation of the smooth deviation between runs, µm.
    pub between_runs_um: f64,
}

/// A floor for each instrument; a rotary axis' encoder has it at [`ROTARY_ARM_MM`].
pub type Floors = BTreeMap<Instrument, AssumedFloor>;

/// Arm at which a length stands for an angle, mm.
pub const ROTARY_ARM_MM: f64 = 100.0;
/// Pairs from this cosine on are told as alike.
pub const MIN_COSINE_ALIKE: f64 = 0.95;
/// Below this sine other effects together imitate one.
pub const IMITATED: f64 = 0.1;
/// Repeats that a noise floor wants.
pub const WANTED_REPEATS: usize = 3;

/// What a programme will be able to show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Preflight {
    /// Channels that will be read.
    pub channels: Vec<PlannedChannel>,
    /// Number of runs.
    pub runs: usize,
    /// Runs that a diagnosis would hold out, by number.
    pub held_out_runs: Vec<u32>,
    /// Effects that would be found, those that are told apart worst first.
    pub effects: Vec<Foreseen>,
    /// Effects that would not show, and what would show them.
    pub not_excited: Vec<NotExcited>,
    /// What could be told from what.
    pub isolability: Isolability,
}

/// One channel of a programme.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedChannel {
    /// Its name.
    pub channel: String,
    /// Runs that read it.
    pub runs: usize,
    /// Times that its most repeated test is run (of touches: touches of one place).
    pub repeats: usize,
    /// The floor that is assumed of it, µm (mrad for a rotary axis).
    pub floor: AssumedFloor,
}

/// One effect on one target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Foreseen {
    /// Id in the catalogue.
    pub effect: String,
    /// What it acts on; empty: the machine.
    pub axis: String,
    /// The amplitude that the sizes are values of.
    pub parameter: String,
    /// Its typical value.
    pub typical: f64,
    /// Its greatest physical value.
    pub greatest: f64,
    /// (1): found in 95 of 100 recordings.
    pub found_from: f64,
    /// Sine of the angle to everything that effects of other kinds imitate together.
    pub sin_alone: f64,
    /// (2): told from every other effect; infinite sizes are absent.
    pub told_apart_from: Option<f64>,
    /// Effects of other kinds whose signature is the same within [`MIN_COSINE_ALIKE`], with the cosine.
    pub alike: Vec<(String, f64)>,
}

/// Least and greatest noise of an instrument that is assumed, µm: readings are weighted by its inverse square.
pub const FLOOR_UM: [f64; 2] = [1e-4, 1e4];

/// Judges a programme by the session that an ideal machine would record of it.
///
/// # Errors
/// For a session without readings, a floor that is none, a machine that cannot be simulated.
pub fn preflight(
    machine: &MachineFile,
    session: &Session,
    floors: &Floors,
    config: &GapConfig,
) -> Result<Preflight, GapError> {
    config.check()?;
    simulate::check(session)?;
    for floor in floors.values() {
        check("reading_um", floor.reading_um)?;
        check("between_runs_um", floor.between_runs_um)?;
    }
    let kinds = considered(config)?;
    let twin = Twin::new(machine)?;
    let all: Vec<usize> = (0..session.runs.len()).collect();
    let stations = stations(session, &all, config);
    let rows = Rows::new(session, &all, stations, |channel| {
        floors.contains_key(&channel.instrument())
    });
    if rows.len == 0 {
        return Err(GapError::NoReadings);
    }
    let noise = assumed(&rows, floors);
    let residual: Vec<Vec<f64>> = session
        .runs
        .iter()
        .map(|run| vec![0.0; run.readings.len()])
        .collect();
    let split = split::split(session, config.hold_out);
    let form = FormError::base(config);
    let stack = Stack::new(
        session, &twin, &split.fit, stations, &noise, &form, &residual,
    );
    let means = kinds.iter().filter(|kind| kind.moment == Moment::Mean);
    let library = Library::new(&stack, Instance::all(machine, means));
    let normal = library.normal(&stack.z);
    let forms = isolability::forms(&library, &normal, &[]);
    let matrix = isolability(&library, &normal, &forms, stack.freedom());
    let of_form = |form: &usize| library.forms[*form].instance;
    let shown: Vec<&Instance> = forms
        .iter()
        .map(|form| &library.instances[of_form(form)])
        .collect();
    let held = |run: &usize| session.runs[*run].segment.run;
    Ok(Preflight {
        channels: channels(session, &rows, floors),
        runs: session.runs.len(),
        held_out_runs: split.held_out.iter().map(held).collect(),
        effects: foreseen(&shown, &matrix),
        not_excited: not_excited(&kinds, &shown),
        isolability: matrix,
    })
}

fn check(name: &'static str, value: f64) -> Result<(), GapError> {
    Ok(check_between(name, value, (FLOOR_UM[0], FLOOR_UM[1]))?)
}

/// The floor of a channel, in its own unit: mm, of a rotary axis rad.
fn floor_of(channel: &Channel, floors: &Floors) -> Option<[f64; 2]> {
    let floor = floors.get(&channel.instrument())?;
    let is_rotary =
        matches!(channel, Channel::Motor(axis) | Channel::Scale(axis) if !axis.is_linear());
    let unit = if is_rotary {
        1e-3 / ROTARY_ARM_MM
    } else {
        1e-3
    };
    Some([floor.reading_um * unit, floor.between_runs_um * unit])
}

pub(crate) fn assumed(rows: &Rows, floors: &Floors) -> BTreeMap<Channel, Noise> {
    let mut noise = BTreeMap::new();
    for block in &rows.blocks {
        let Some([reading, between]) = floor_of(&block.channel, floors) else {
            continue;
        };
        let readings: usize = block.rows.iter().map(|row| row.readings.len()).sum();
        let row_sigma_mm = reading / (count(readings) / count(block.rows.len())).sqrt();
        let third = between / 3.0_f64.sqrt();
        let _ = noise.entry(block.channel.clone()).or_insert(Noise {
            within: Autoregression::white(row_sigma_mm.powi(2)),
            pace: Pace::default(),
            between: Smooth {
                place_mm: third,
                length_rad: 0.5,
                offset_mm: third,
                drift_mm: between,
            },
            row_sigma_mm,
            reading_sigma_mm: reading,
            repeats: WANTED_REPEATS,
            freedom: count(rows.len),
            field_freedom: count(rows.blocks.len()),
        });
    }
    noise
}

fn channels(session: &Session, rows: &Rows, floors: &Floors) -> Vec<PlannedChannel> {
    let repeats = repeats::contrasts(session, rows, &vec![0.0; rows.len], &[]);
    let mut runs = BTreeMap::<&Channel, usize>::new();
    for block in &rows.blocks {
        *runs.entry(&block.channel).or_default() += 1;
    }
    let planned = |(channel, runs): (&Channel, usize)| {
        let [reading, between] = floor_of(channel, floors)?;
        let groups = repeats.get(channel).map_or(&[][..], Vec::as_slice);
        Some(PlannedChannel {
            channel: channel.to_string(),
            runs,
            repeats: groups.iter().map(repeated).max().unwrap_or(1),
            floor: AssumedFloor {
                reading_um: reading * 1e3,
                between_runs_um: between * 1e3,
            },
        })
    };
    runs.into_iter().filter_map(planned).collect()
}

/// How often a test is run; trends in time are taken off the differences, so that they count fewer.
fn repeated(group: &repeats::Contrasts) -> usize {
    group.blocks.len().max(group.values.len() + 1)
}

fn foreseen(shown: &[&Instance], matrix: &Isolability) -> Vec<Foreseen> {
    let of = |k: usize, instance: &&Instance| {
        let parameter = matrix.unit.get(k)?;
        let kind = instance.kind;
        let of_kind = kind.parameters.iter().chain(kind.free);
        let entry = of_kind.into_iter().find(|p| p.name == parameter)?;
        let (found_from, sin_alone) = (*matrix.detectable.get(k)?, *matrix.sin_alone.get(k)?);
        let alike = (0..shown.len()).filter(|other| shown[*other].kind.id != kind.id);
        let cos = |other: usize| matrix.cos.get(k).and_then(|row| row.get(other)).copied();
        let mut alike: Vec<(String, f64)> = alike
            .filter_map(|other| Some((shown[other].name(), cos(other)?.abs())))
            .filter(|(_, cos)| *cos >= MIN_COSINE_ALIKE)
            .collect();
        alike.sort_by(|a, b| b.1.total_cmp(&a.1));
        Some(Foreseen {
            effect: kind.id.to_owned(),
            axis: instance.target.to_string(),
            parameter: parameter.clone(),
            typical: entry.typical,
            greatest: entry.high.max(-entry.low),
            found_from,
            sin_alone,
            told_apart_from: (sin_alone > 1e-6).then(|| found_from / sin_alone),
            alike,
        })
    };
    let each = shown.iter().enumerate();
    let mut all: Vec<Foreseen> = each.filter_map(|(k, instance)| of(k, instance)).collect();
    all.sort_by(|a, b| a.sin_alone.total_cmp(&b.sin_alone));
    all
}

/// Kinds of which no instance would show.
fn not_excited(kinds: &[&'static Kind], shown: &[&Instance]) -> Vec<NotExcited> {
    let seen = |kind: &Kind| shown.iter().any(|instance| instance.kind.id == kind.id);
    let means = kinds.iter().filter(|kind| kind.moment == Moment::Mean);
    means
        .filter(|kind| !seen(kind))
        .map(|kind| NotExcited {
            effect: kind.id.to_owned(),
            needs: kind.needs.to_owned(),
        })
        .collect()
}

#[cfg(test)]
pub(crate) mod rig;

#[cfg(test)]
mod tests {
    use super::rig::{circles, floors, machine};
    use super::*;

    #[test]
    fn eq1_a_backlash_of_the_foreseen_size_has_the_d_that_detects() {
        let (machine, config) = (machine(), GapConfig::default());
        let session = circles(&machine, &[50.0, 25.0], 3);
        let found = preflight(&machine, &session, &floors(0.3), &config).expect("a forecast");
        let of = |effect: &str, axis: &str| {
            let all = found.effects.iter();
            let mut all = all.filter(|one| one.effect == effect && one.axis == axis);
            all.next().expect("it shows").clone()
        };
        let play = of("backlash", "X");
        // The same size simulated as an effect of the machine, against the D of (1).
        let twin = Twin::new(&machine).expect("a twin");
        let all: Vec<usize> = (0..session.runs.len()).collect();
        let stations = stations(&session, &all, &config);
        let rows = Rows::new(&session, &all, stations, |_| true);
        let noise = assumed(&rows, &floors(0.3));
        let zero: Vec<Vec<f64>> = session
            .runs
            .iter()
            .map(|r| vec![0.0; r.readings.len()])
            .collect();
        let split = split::split(&session, config.hold_out);
        let form = FormError::base(&config);
        let stack = Stack::new(&session, &twin, &split.fit, stations, &noise, &form, &zero);
        let kind = twin::effects::kind("backlash").expect("in the catalogue");
        let mut values = kind.typical();
        values[0] = play.found_from;
        let target = kind.targets_on(&machine).remove(0);
        let d = stack.signature(&*(kind.build)(target, &values)).norm();
        let seen = found.isolability.names.len();
        let d95 = (stack.freedom().ln() + 2.0 * count(seen).ln()).sqrt() + 1.64;
        assert!((d / d95 - 1.0).abs() < 0.1, "{d} {d95}");
        assert!((0.01..1.0).contains(&play.found_from), "{play:?}");
    }

    #[test]
    fn a_floor_twice_as_high_hides_effects_up_to_twice_as_large() {
        let machine = machine();
        let session = circles(&machine, &[50.0], 3);
        let of = |between_um: f64| {
            let found = preflight(
                &machine,
                &session,
                &floors(between_um),
                &GapConfig::default(),
            );
            let effects = found.expect("a forecast").effects;
            let square = effects.into_iter().find(|one| one.effect == "squareness");
            square.expect("it shows").found_from
        };
        let ratio = of(1.0) / of(0.5);
        // The error of form is the same in both.
        assert!((1.5..=2.0).contains(&ratio), "{ratio}");
    }

    #[test]
    fn what_a_programme_cannot_show_is_told_with_what_would() {
        let machine = machine();
        let session = circles(&machine, &[50.0], 1);
        let found = preflight(&machine, &session, &floors(0.3), &GapConfig::default());
        let found = found.expect("a forecast");
        let hidden: Vec<&str> = found
            .not_excited
            .iter()
            .map(|k| k.effect.as_str())
            .collect();
        for effect in ["probe_latency", "probe_lobing", "rotary_location"] {
            assert!(hidden.contains(&effect), "{hidden:?}");
        }
        assert!(found.not_excited.iter().all(|kind| !kind.needs.is_empty()));
        assert_eq!(found.channels.len(), 2);
        assert_eq!(found.channels[0].repeats, 1);
        // In one plane, squareness and a scale error of opposite signs are no strangers, but play is itself.
        let sine = |effect: &str| {
            let of = found.effects.iter().filter(|one| one.effect == effect);
            of.map(|one| one.sin_alone).fold(0.0, f64::max)
        };
        assert!(sine("backlash") > sine("squareness"));
        let nothing = Floors::new();
        let error = preflight(&machine, &session, &nothing, &GapConfig::default());
        assert_eq!(error, Err(GapError::NoReadings));
    }
}
