//! Arm s4: a shift of four hours with circles, block cycles and production.
//!
//! The session is written as samples (`samples`), not run servo period by servo period: circles and touches are fine,
//! production, rest and heat are coarse. Its physics is that of the arms before: `machine_motion` for what circles show,
//! `heat` for what warms; steps, creep and growth of a shift are in `hidden`.

use std::fmt::Write as _;

use rand::Rng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

use super::ballbar::{MIN_D_APART, counted, look_alikes, motions};
use super::dice::{how_many, log_uniform, sign};
use super::metric::Floor;
use super::truth::{Name, ShiftTimes, ShopEffect, ShopTruth};
use super::{Shift, ShopSession};

use hidden::{Effect, Kind};
use imitators::{Imitator, has_imitators, imitators};
use samples::{INSET_MM, samples};
use size::{Sizing, Weighed, courses};
use timetable::Timetable;
use warmth::Warmth;

pub use samples::Samples;

mod hidden;
mod imitators;
mod samples;
mod size;
mod timetable;
mod warmth;

/// D of hidden effects.
const D_OF_SHIFT: [f64; 2] = [4.0, 300.0];
/// Noise of a touch and of a cycle, µm.
const TOUCH_WHITE_UM: [f64; 2] = [0.1, 0.5];
const TOUCH_BETWEEN_UM: [f64; 2] = [0.1, 0.4];

/// An effect with its size.
struct Sized {
    effect: Effect,
    size: f64,
    one: Vec<f64>,
    weighed: Weighed,
}

/// Draws a session.
pub fn draw(random: &mut Pcg64Mcg) -> ShopSession {
    let table = Timetable::draw(random);
    let warmth = Warmth::draw(random, &table);
    let lead_mm = [5.0, 10.0, 16.0, 20.0][random.random_range(0..4)];
    let memory = random.random_range(0.5..0.95);
    let floors = [
        Floor::draw(random, [0.1, 0.6], [0.05, 0.4]).with_memory(memory),
        Floor::draw(random, TOUCH_WHITE_UM, TOUCH_BETWEEN_UM),
    ];
    let sizing = Sizing::of(&floors, &table);
    let count = how_many(random);
    let wanted = wanted(random, &table, &warmth, lead_mm, count);
    let of = |effect| hide(random, effect, &table, &sizing);
    let hidden: Vec<Sized> = wanted.into_iter().map(of).collect();
    let effects = effects(&table, &warmth, &sizing, &hidden);
    let zeros = vec![0.0; noise(random, &floors, &table).len()];
    let with = hidden.iter().fold(zeros.clone(), |sum, own| {
        let both = sum.iter().zip(&own.one);
        both.map(|(sum, one)| sum + own.size * one).collect()
    });
    let (now, later) = (
        noise(random, &floors, &table),
        noise(random, &floors, &table),
    );
    let mut written = |signal: &[f64], noise: &[f64]| {
        let readings: Vec<f64> = signal.iter().zip(noise).map(|(a, b)| a + b).collect();
        samples(random, &table, &warmth, &readings)
    };
    let shift = Shift {
        samples: written(&with, &now),
        bare: written(&zeros, &now),
        later: written(&with, &later),
    };
    ShopSession {
        tables: vec![],
        machine: machine(&table, &warmth, lead_mm),
        truth: truth(&table, &warmth, &floors, effects),
        shift: Some(shift),
    }
}

fn truth(
    table: &Timetable,
    warmth: &Warmth,
    floors: &[Floor; 2],
    effects: Vec<ShopEffect>,
) -> ShopTruth {
    let planes = table.tables.chunk_by(|a, b| a.plane == b.plane).count();
    let feeds = table.tables.len() / planes.max(1);
    ShopTruth {
        session: format!(
            "shift, {} and {}",
            counted(planes, "plane"),
            counted(feeds, "feed")
        ),
        layout: format!(
            "{} and {}",
            counted(table.blocks.len(), "block"),
            counted(warmth.thermometers.len(), "thermometer")
        ),
        repeats: table.cycles().count(),
        places: planes,
        effects,
        white_um: floors[0].white_um,
        between_runs_um: floors[0].between_runs_um,
        memory: floors[0].memory,
        shift: Some(ShiftTimes {
            begins_s: table.begins_s(),
            cycle_s: table.cycle_s(),
        }),
    }
}

/// Different effects, of which no two have a name in common.
fn wanted(
    random: &mut Pcg64Mcg,
    table: &Timetable,
    warmth: &Warmth,
    lead_mm: f64,
    count: usize,
) -> Vec<Effect> {
    let mut all: Vec<Effect> = motions(random, &table.tables, lead_mm, 4)
        .into_iter()
        .map(|motion| Effect::of_motion(random, motion))
        .collect();
    for which in 0..Effect::OTHERS {
        all.push(Effect::other(random, which, table.blocks.len(), warmth));
    }
    // What would begin after the last test that shows it shows nothing.
    all.retain(|effect| effect.begins == hidden::Begins::Always || effect.change(table).is_some());
    all.shuffle(random);
    all.truncate(count);
    all
}

/// An effect at a size whose D is drawn.
fn hide(random: &mut Pcg64Mcg, effect: Effect, table: &Timetable, sizing: &Sizing) -> Sized {
    let one = effect.readings_um(table);
    let weighed = sizing.weigh(&one);
    let d_of_one = sizing.d(&weighed, &[]);
    let ([low, high], _) = effect.sizes();
    let size = (log_uniform(random, D_OF_SHIFT) / d_of_one.max(1e-9)).clamp(low, high);
    let size = if effect.has_both_signs() {
        sign(random) * size
    } else {
        size
    };
    let readings: Vec<f64> = one.iter().map(|value| size * value).collect();
    Sized {
        effect,
        size,
        weighed: sizing.weigh(&readings),
        one,
    }
}

/// What is true of the effects.
fn effects(
    table: &Timetable,
    warmth: &Warmth,
    sizing: &Sizing,
    hidden: &[Sized],
) -> Vec<ShopEffect> {
    let has_any = hidden.iter().any(|own| has_imitators(&own.effect));
    let known = if has_any {
        imitators(table, warmth, sizing)
    } else {
        vec![]
    };
    let of = |own: usize| {
        let Sized {
            effect,
            size,
            weighed,
            ..
        } = &hidden[own];
        let others = || hidden.iter().enumerate().filter(|(k, _)| *k != own);
        let taken_out: Vec<&Weighed> = others().map(|(_, other)| &other.weighed).collect();
        let d_alone = sizing.d(weighed, &taken_out);
        let (names, besides) = names(effect, &known, sizing, weighed);
        let mut same: Vec<Name> = match &effect.kind {
            Kind::Drive(motion) => look_alikes(&table.tables, motion),
            _ if has_imitators(effect) => {
                let alike = known
                    .iter()
                    .filter(|it| it.is_same(sizing, weighed, &taken_out));
                alike.map(|it| it.name().clone()).collect()
            }
            _ => vec![],
        };
        if d_alone < MIN_D_APART && !names.is_empty() {
            same.extend(others().flat_map(|(_, other)| other.effect.names()));
        }
        same.retain(|other| !names.contains(other) && !besides.contains(other));
        same.sort();
        same.dedup();
        ShopEffect {
            what: effect.words(),
            names,
            besides,
            same_readings: same,
            size: *size,
            unit: effect.sizes().1.to_owned(),
            d: sizing.d(weighed, &[]),
            d_alone,
            follow: None,
            parameter: effect
                .parameter()
                .map(|(name, one)| (name.to_owned(), one * size)),
            change: effect.change(table),
        }
    };
    (0..hidden.len()).map(of).collect()
}

/// Names by which the catalogue describes an effect, and true ones whose form does not: without a thermometer beside it
/// the growth of a spindle follows time alone.
fn names(
    effect: &Effect,
    known: &[Imitator],
    sizing: &Sizing,
    own: &Weighed,
) -> (Vec<Name>, Vec<Name>) {
    if !has_imitators(effect) {
        return (effect.names(), vec![]);
    }
    let describes = |wanted: &Name| {
        let imitator = known.iter().find(|it| it.name() == wanted);
        imitator.is_some_and(|it| it.describes(sizing, own))
    };
    effect.names().into_iter().partition(describes)
}

/// Noise of every reading, µm.
fn noise(random: &mut Pcg64Mcg, floors: &[Floor; 2], table: &Timetable) -> Vec<f64> {
    let mut all = vec![];
    for (floor, courses) in floors.iter().zip(courses(table)) {
        for course in courses {
            all.extend(floor.run(random, &course));
        }
    }
    all
}

fn machine(table: &Timetable, warmth: &Warmth, lead_mm: f64) -> String {
    let mut text = super::positioning::machine([lead_mm; 3]) + "blocks:\n";
    for block in &table.blocks {
        let [x, y, z] = block.corner_mm;
        let senses = block
            .senses
            .map(|sense| if sense < 0.0 { "-1" } else { "1" });
        let _ = writeln!(
            text,
            "  - {{id: {}, corner_mm: [{x:.1}, {y:.1}, {z:.1}], approach_sign: [{}], inset_mm: {INSET_MM:.1}}}",
            block.id,
            senses.join(", ")
        );
    }
    if !warmth.thermometers.is_empty() {
        text += "temperature_sensors:\n";
    }
    for thermometer in &warmth.thermometers {
        let id = thermometer.id;
        let _ = writeln!(text, "  - {{id: {id}, place: {id}, period_s: 60.0}}");
    }
    text
}

#[cfg(test)]
mod tests {
    use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
    use machine::MachineFile;
    use metrology::sample::TestKind;
    use rand::SeedableRng;
    use twin::Channel;

    use super::*;
    use crate::arm::Arm;
    use crate::measurement::Sample;

    fn session(index: u64) -> ShopSession {
        ShopSession::draw(Arm::ShopShift, 8, index).unwrap()
    }

    #[test]
    fn a_number_always_draws_the_same_shift_and_another_one_another() {
        // Scales that are absent are no numbers, which equal nothing.
        let text = |index: u64| format!("{:?}", session(index));
        assert_eq!(text(4), text(4));
        assert_ne!(text(4), text(5));
    }

    #[test]
    fn a_shift_has_states_without_holes_and_its_machine_file_is_one() {
        let session = session(1);
        MachineFile::parse(&session.machine, "drawn").unwrap();
        let shift = session.shift.unwrap();
        let states = shift
            .samples
            .iter()
            .filter_map(|(at, sample)| match sample {
                Sample::State(_) => Some(*at),
                _ => None,
            });
        let states: Vec<_> = states.collect();
        let apart = states.windows(2).map(|two| (two[1] - two[0]).as_secs_f64());
        let (mut longest_s, mut shortest_s) = (0.0_f64, f64::MAX);
        apart.for_each(|s| (longest_s, shortest_s) = (longest_s.max(s), shortest_s.min(s)));
        assert!(
            longest_s < 4.0 && shortest_s > 0.0,
            "{shortest_s} {longest_s}"
        );
        assert!(states.len() < 150_000, "{}", states.len());
    }

    fn input(sample: Sample) -> Input {
        match sample {
            Sample::State(state) => Input::State(state),
            Sample::Grid(sample) => Input::Grid(sample),
            Sample::Length(sample) => Input::Length(sample),
            Sample::Trigger(trigger) => Input::Trigger(trigger),
            Sample::Temperature(sample) => Input::Temperature(sample),
            Sample::Segment(segment) => Input::Segment(segment),
        }
    }

    #[test]
    fn every_test_of_a_shift_is_read_with_all_its_readings() {
        let mut random = Pcg64Mcg::seed_from_u64(12);
        let table = Timetable::draw(&mut random);
        let warmth = Warmth::draw(&mut random, &table);
        let readings = vec![1.5; noise_free(&table)];
        let samples = samples(&mut random, &table, &warmth, &readings);
        let file = MachineFile::parse(&machine(&table, &warmth, 10.0), "drawn").unwrap();
        let mut builder = SessionBuilder::new(&file, SessionConfig::default()).unwrap();
        samples
            .into_iter()
            .for_each(|(_, sample)| builder.take(input(sample)));
        let (session, _) = builder.finish().unwrap();
        assert_eq!(session.runs.len(), table.begins_s().len());
        for run in &session.runs {
            let is_circle = run.segment.kind == TestKind::Circle;
            let channel = if is_circle {
                Channel::Radial
            } else {
                Channel::Touch
            };
            let own = run
                .readings
                .iter()
                .filter(|reading| reading.channel == channel);
            let wanted = if is_circle {
                table.tables[0].circles[0].angles.len()
            } else {
                table.cycles().next().unwrap().touches.len()
            };
            let own: Vec<f64> = own.map(|reading| reading.deviation).collect();
            assert!(own.len() * 10 >= wanted * 9, "{} of {wanted}", own.len());
            for mm in own {
                assert!(
                    (mm.abs() - 1.5e-3).abs() < 1e-4,
                    "{:?} {mm}",
                    run.segment.kind
                );
            }
        }
    }

    /// Number of readings.
    fn noise_free(table: &Timetable) -> usize {
        courses(table).iter().flatten().map(Vec::len).sum()
    }

    #[test]
    fn truths_have_every_kind_and_instants_of_what_changes() {
        let truths: Vec<ShopTruth> = (0..60).map(|index| session(index).truth).collect();
        let effects = || truths.iter().flat_map(|truth| &truth.effects);
        assert!(truths.iter().any(|truth| truth.effects.is_empty()));
        assert!(truths.iter().all(|truth| truth.effects.len() < 4));
        assert!(effects().any(ShopEffect::is_resolvable));
        assert!(effects().any(|effect| !effect.same_readings.is_empty()));
        assert!(effects().any(|effect| effect.names.is_empty()));
        assert!(effects().any(|effect| effect.parameter.is_some()));
        let changes = || effects().filter_map(|effect| effect.change);
        assert!(changes().count() > 10);
        assert!(changes().all(|it| it.between_s[0] < it.at_s && it.at_s <= it.between_s[1]));
        for effect in effects() {
            assert!(
                effect.d > 0.0 && effect.d_alone <= 1.001 * effect.d,
                "{effect:?}"
            );
        }
    }
}
