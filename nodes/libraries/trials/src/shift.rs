//! Arm s4: a shift of four hours on the plant, with production between its tests.
//!
//! A machine has worked the day before, stood off over the night, and works again. Blocks are touched every 15 to 30
//! minutes and circles run at the beginning, in the middle and at the end (`programme`). What lies between passes in coarse
//! steps, in which heat and wear go on (`work`, `fake_cnc`'s `Plant::work`). Hidden is what the plant can have (`hidden`), and
//! what changes during the shift (`change`, `plate`).
//!
//! D is that of `size`. Of each hidden effect those of the plant that may look like it are measured on the same machine: what of
//! it is below [`MAX_D_OF_SAME`] beside one of them cannot be told from it, and the right answer is a set with both.
//!
//! ```text
//!   D(s beside r) < 3:   r is among what makes the same readings          (1)
//! ```

use metrology::Axis;
use rand::Rng;
use rand::seq::IndexedRandom;
use rand_pcg::Pcg64Mcg;

use change::{Change, Kind};
use programme::{Programme, Timeline};

use crate::arm::Arm;
use crate::commissioning::Commissioning;
use crate::effect::Hidden;
use crate::error::TrialError;
use crate::measurement::measure;
use crate::own;
use crate::rig::{Rig, STATE_RATE_HZ};
use crate::shop::dice::{how_many, log_uniform};
use crate::shop::{Name, ShiftTruth, ShopEffect, ShopTruth, TrueChange, name};
use crate::size::Deviations;
use crate::trial::stream;

mod change;
mod hidden;
mod plate;
mod programme;
mod work;

pub use plate::PlateMove;
pub(crate) use plate::PlateWay;
pub use work::{Spell, Stroke};

/// Range of D of effects, and of changes.
const D_OF_EFFECTS: [f64; 2] = [2.0, 200.0];
const D_OF_CHANGES: [f64; 2] = [5.0, 300.0];
/// Below this D an effect is drawn anew.
const MIN_D: f64 = 1.0;
/// Below this D beside another both make the same readings.
const MAX_D_OF_SAME: f64 = 3.0;
/// Share of shifts that hide something in which something changes.
const CHANGING: f64 = 0.65;
/// Draws of an effect before a shift has one less.
const MOST_DRAWS: usize = 12;
/// Period of a thermometer, s, and the share of them that a shop has.
const THERMOMETER_S: f64 = 60.0;
const THERE: f64 = 0.8;
/// Share of machines whose tool shakes.
const SHAKING: f64 = 0.5;
/// Torque of nuts and bearings that hardly warm their screws, N m.
const EASY_N_M: f64 = 0.002;

/// A shift before it is measured.
#[derive(Clone, Debug)]
pub struct ShiftTrial {
    /// Everything that its session follows from.
    pub rig: Rig,
    /// The same before anything was hidden.
    pub bare: Rig,
    /// What is to be found.
    pub truth: ShopTruth,
}

/// A machine with its shift, and how it reads with nothing hidden.
struct Bench {
    rig: Rig,
    programme: Programme,
    bare: Deviations,
    timeline: Timeline,
    /// How long it has worked before the session, s.
    past_s: f64,
}

/// What is hidden.
#[derive(Clone, Debug)]
enum Thing {
    Effect(Hidden),
    Change(Change),
}

/// What is hidden at its size, with the readings of a machine that has nothing else.
struct Found {
    thing: Thing,
    size: f64,
    d: f64,
    with: Deviations,
}

impl ShiftTrial {
    /// Draws the shift of a number in a series.
    ///
    /// # Errors
    /// When what is drawn breaks a rule, or cannot be measured.
    pub fn draw(seed: u64, index: u64) -> Result<Self, TrialError> {
        let mut random = stream(Arm::ShopShift, seed, index);
        let bench = Bench::draw(&mut random)?;
        let mut found: Vec<Found> = vec![];
        let count = how_many(&mut random);
        let changes = count > 0 && random.random::<f64>() < CHANGING;
        for place in 0..count {
            let is_change = changes && place + 1 == count;
            found.extend(bench.hidden(&mut random, is_change, &found)?);
        }
        let mut rig = bench.rig.clone();
        for own in &found {
            own.thing.hide(own.size, &mut rig, bench.past_s)?;
        }
        let truth = bench.truth(&found)?;
        Ok(Self {
            rig,
            bare: bench.rig,
            truth,
        })
    }
}

impl Thing {
    fn hide(&self, size: f64, rig: &mut Rig, past_s: f64) -> Result<(), TrialError> {
        match self {
            Self::Effect(own) => hidden::hide(&own.sized(size), rig),
            Self::Change(own) => own.hide(size, rig, past_s),
        }
    }

    const fn sizes(&self) -> ([f64; 2], &'static str) {
        match self {
            Self::Effect(own) => own.class.sizes(),
            Self::Change(own) => own.kind.sizes(),
        }
    }

    const fn words(&self) -> &'static str {
        match self {
            Self::Effect(own) => hidden::words(own),
            Self::Change(own) => own.kind.words(),
        }
    }

    /// Names that are true of it, and those that may be there as well.
    fn names(&self) -> [Vec<Name>; 2] {
        match self {
            Self::Effect(own) => hidden::names(own),
            Self::Change(own) => own.names(),
        }
    }

    /// Whether two are the same, but for their sizes.
    fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Effect(one), Self::Effect(other)) => {
                (one.class, one.axis) == (other.class, other.axis)
            }
            (Self::Effect(one), Self::Change(change))
            | (Self::Change(change), Self::Effect(one)) => {
                change.names()[0].contains(&name(one.class.id(), one.axis))
            }
            (Self::Change(_), Self::Change(_)) => true,
        }
    }
}

impl Bench {
    fn draw(random: &mut Pcg64Mcg) -> Result<Self, TrialError> {
        let mut rig = Rig::draw(random, false)?;
        let programme = Programme::draw(random);
        prepare(random, &programme, &mut rig)?;
        let past_s = work::length_s(&rig.past);
        let mut with_motors = rig.clone();
        with_motors.has_motors = true;
        let (mut bare, mut timeline) = (Deviations::default(), Timeline::default());
        let mut commissioning = Commissioning::new(&rig.machine, STATE_RATE_HZ);
        measure(&with_motors, &mut |at, sample| {
            commissioning.take(&sample);
            bare.take(at, &sample);
            timeline.take(at, &sample);
        })?;
        commissioning.tune(&mut rig.machine);
        Ok(Self {
            rig,
            programme,
            bare,
            timeline,
            past_s,
        })
    }

    /// Draws something to be hidden that the shift can show and nothing else of it is; none after too many draws.
    fn hidden(
        &self,
        random: &mut Pcg64Mcg,
        is_change: bool,
        others: &[Found],
    ) -> Result<Option<Found>, TrialError> {
        let range = if is_change {
            D_OF_CHANGES
        } else {
            D_OF_EFFECTS
        };
        for _ in 0..MOST_DRAWS {
            let Some((thing, is_negative)) = self.thing(random, is_change) else {
                continue;
            };
            if others.iter().any(|other| other.thing.is_like(&thing)) {
                continue;
            }
            let wanted = log_uniform(random, range);
            let found = self.sized(thing, is_negative, wanted)?;
            if found.d >= MIN_D {
                return Ok(Some(found));
            }
        }
        Ok(None)
    }

    /// Something without its size, and whether that is negative.
    fn thing(&self, random: &mut Pcg64Mcg, is_change: bool) -> Option<(Thing, bool)> {
        let planes: Vec<[Axis; 2]> = self.programme.planes().collect();
        if is_change {
            let kind = *Kind::ALL.choose(random)?;
            let axes: Vec<Axis> = planes.into_iter().flatten().collect();
            let change = Change::draw(random, kind, &self.timeline, &axes)?;
            return Some((Thing::Change(change), false));
        }
        let class = *hidden::CLASSES.choose(random)?;
        let axis = *class.axes().choose(random)?;
        let own = Hidden {
            class,
            axis,
            size: 1.0,
            is_foreign: true,
            shape: [random.random(), random.random()],
        };
        let is_negative = class.has_both_signs() && random.random::<bool>();
        hidden::is_shown(class, axis, &planes).then_some((Thing::Effect(own), is_negative))
    }

    /// The same at the size whose D is `wanted`, or at the end of its range.
    fn sized(&self, thing: Thing, is_negative: bool, wanted: f64) -> Result<Found, TrialError> {
        let sign = if is_negative { -1.0 } else { 1.0 };
        let ([low, high], _) = thing.sizes();
        let middle = (low * high).sqrt();
        let d = self.d(&self.with(&thing, sign * middle)?);
        let size = sign * (middle * wanted / d.max(1e-6)).clamp(low, high);
        let with = self.with(&thing, size)?;
        Ok(Found {
            d: self.d(&with),
            thing,
            size,
            with,
        })
    }

    /// Readings of the machine with something hidden.
    fn with(&self, thing: &Thing, size: f64) -> Result<Deviations, TrialError> {
        let mut rig = self.rig.clone();
        rig.has_motors = true;
        thing.hide(size, &mut rig, self.past_s)?;
        let mut deviations = Deviations::default();
        measure(&rig, &mut |at, sample| deviations.take(at, &sample))?;
        Ok(deviations)
    }

    fn d(&self, with: &Deviations) -> f64 {
        with.d_against(&self.bare, &self.rig.scatter, self.rig.shaking_mm2())
    }

    fn d_beside(&self, with: &Deviations, others: &[&Deviations]) -> f64 {
        let (scatter, shaking_mm2) = (&self.rig.scatter, self.rig.shaking_mm2());
        with.d_beside(&self.bare, others, scatter, shaking_mm2)
    }

    fn truth(&self, found: &[Found]) -> Result<ShopTruth, TrialError> {
        let each = (0..found.len()).map(|own| self.effect(found, own));
        let effects: Vec<ShopEffect> = each.collect::<Result<_, _>>()?;
        let places = found.iter().enumerate();
        let changes = places.filter_map(|(place, own)| match &own.thing {
            Thing::Change(change) => Some(TrueChange {
                effect: place,
                from_s: change.from_s,
                until_s: change.until_s,
                cycle_s: change.cycle_s,
            }),
            Thing::Effect(_) => None,
        });
        let planes = self.programme.planes().count();
        let feeds = if self.programme.has_two_feeds { 2 } else { 1 };
        let often = if self.programme.every_s() < 20.0 * 60.0 {
            "blocks every 15 to 20 min"
        } else {
            "blocks every 20 to 30 min"
        };
        let scatter = &self.rig.scatter;
        let runs = self.timeline.runs.iter();
        Ok(ShopTruth {
            session: often.to_owned(),
            layout: format!(
                "{feeds} feed{}, {planes} plane{}",
                if feeds == 1 { "" } else { "s" },
                if planes == 1 { "" } else { "s" }
            ),
            repeats: self.programme.intervals + 1,
            places: self.rig.machine.temperature_sensors.len(),
            effects,
            white_um: scatter.white_mm * 1e3,
            between_runs_um: scatter.between_runs_mm * 1e3,
            memory: scatter.ar,
            shift: Some(ShiftTruth {
                runs_s: runs.map(|run| (run.number, run.from_s)).collect(),
                changes: changes.collect(),
            }),
        })
    }

    fn effect(&self, found: &[Found], own: usize) -> Result<ShopEffect, TrialError> {
        let Found {
            thing,
            size,
            d,
            with,
        } = &found[own];
        let others = || {
            let all = found.iter().enumerate();
            all.filter(move |(k, _)| *k != own).map(|(_, other)| other)
        };
        let [names, besides] = thing.names();
        let mut same = self.same_by_rule(thing);
        for other in others() {
            if self.d_beside(with, &[&other.with]) < MAX_D_OF_SAME {
                same.extend(other.thing.names()[0].clone());
            }
        }
        same.extend(self.same_readings(thing, with)?);
        same.retain(|other| !names.contains(other));
        same.sort();
        same.dedup();
        let signatures: Vec<&Deviations> = others().map(|other| &other.with).collect();
        Ok(ShopEffect {
            what: thing.words().to_owned(),
            // What has no name in the catalogue has nothing that could be a set with it.
            same_readings: if names.is_empty() { vec![] } else { same },
            names,
            besides,
            size: *size,
            unit: thing.sizes().1.to_owned(),
            d: *d,
            d_alone: self.d_beside(with, &signatures).min(*d),
            follow: None,
        })
    }

    /// Names of rivals of the plant by (1).
    fn same_readings(&self, thing: &Thing, with: &Deviations) -> Result<Vec<Name>, TrialError> {
        let Thing::Effect(own) = thing else {
            return Ok(vec![]);
        };
        let planes: Vec<[Axis; 2]> = self.programme.planes().collect();
        let mut same = vec![];
        for (class, axis) in hidden::rivals(own) {
            if !hidden::is_shown(class, axis, &planes) {
                continue;
            }
            let rival = Hidden {
                class,
                axis,
                is_foreign: false,
                ..*own
            };
            let ([low, high], _) = class.sizes();
            let rival = Thing::Effect(rival);
            let other = self.with(&rival, (low * high).sqrt())?;
            if self.d_beside(with, &[&other]) < MAX_D_OF_SAME {
                same.extend(rival.names()[0].clone());
            }
        }
        Ok(same)
    }

    /// Names of the catalogue that the plant has not, and that this programme does not tell from it.
    fn same_by_rule(&self, thing: &Thing) -> Vec<Name> {
        let names = thing.names()[0].clone();
        let mut same = vec![];
        for (id, axis) in &names {
            // Lost motion at one feed is also one that depends on the feed.
            if id == "backlash" && !self.programme.has_two_feeds {
                same.push(name("feed_lost_motion", axis));
            }
            // Without the motors' encoders nobody knows on which side of them a drive gives way.
            if id == "drive_windup" && !self.rig.has_motors {
                same.push(name("acceleration_lag", axis));
            }
        }
        same
    }
}

/// Gives a machine its shift: plan, production, the day before, thermometers; what would warm it without being hidden is out.
fn prepare(random: &mut Pcg64Mcg, programme: &Programme, rig: &mut Rig) -> Result<(), TrialError> {
    let spindle = &mut rig.plant.heat.spindle;
    spindle.front_bearing_w_at_1000_rpm = 0.0;
    spindle.rear_bearing_w_at_1000_rpm = 0.0;
    spindle.motor_w_at_1000_rpm = 0.0;
    for screw in rig.plant.heat.screws.values_mut() {
        (screw.nut_torque_n_m, screw.bearing_torque_n_m) = (EASY_N_M, EASY_N_M);
    }
    own::add_thermometers(rig);
    let is_there: Vec<bool> = { rig.machine.temperature_sensors.iter() }
        .map(|_| random.random::<f64>() < THERE)
        .collect();
    own::in_both_files(rig, |file| {
        let mut is_there = is_there.iter();
        let sensors = &mut file.temperature_sensors;
        sensors.retain(|_| is_there.next().copied().unwrap_or(true));
        for sensor in sensors {
            sensor.period_s = THERMOMETER_S;
        }
    });
    let part = Spell::part(random, programme::travels_mm(&rig.machine));
    rig.plan = programme.plan()?;
    rig.production = programme.production(random, &part);
    rig.programs = programme::texts(rig.production.keys());
    rig.past = work::night_before(random, &part);
    if random.random::<f64>() < SHAKING {
        rig.shake(random);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
