//! Arm s1: one ISO 230-2 run of an axis with a laser.

use rand::Rng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

use super::dice::{how_many, log_uniform, sign};
use super::layout::{Layout, Run, write};
use super::lead::{Kind, readings, resolves};
use super::metric::{Floor, Metric};
use super::truth::{Name, ShopEffect, ShopTruth, name};
use super::{ShopSession, Table};

/// D of hidden effects.
const D_OF_POSITIONING: [f64; 2] = [4.0, 300.0];
/// Feed between the targets, mm/s.
const FEED_MM_S: f64 = 100.0;
/// Range of a stop's dwell, s.
const DWELL_S: [f64; 2] = [2.0, 10.0];
/// How far beyond an end the axis turns round, mm.
const OVERRUN_MM: f64 = 5.0;
/// D that other hidden effects must leave of one that can be told from them.
const MIN_D_APART: f64 = 5.0;
/// Travels, mm.
const TRAVELS_MM: [(&str, [f64; 2]); 3] = [
    ("X", [-320.0, 320.0]),
    ("Y", [-240.0, 240.0]),
    ("Z", [-60.0, 440.0]),
];

/// One reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Its cycle, from 0.
    pub cycle: usize,
    /// Sense of approach.
    pub is_up: bool,
    /// Its target, from 0.
    pub target: usize,
    /// Where the axis was sent, mm.
    pub place_mm: f64,
    /// When it was read, s.
    pub time_s: f64,
}

/// Everything of a run but what is hidden.
struct Plan {
    axis: &'static str,
    layout: Layout,
    targets_mm: Vec<f64>,
    cycles: usize,
    dwell_s: f64,
    lead_mm: f64,
    /// Where the other two axes stand, mm.
    others_mm: [f64; 2],
}

/// What is hidden, with its readings at size 1.
struct Hidden {
    kind: Kind,
    size: f64,
    one: Vec<f64>,
    period_mm: f64,
}

/// Draws a session.
pub fn draw(random: &mut Pcg64Mcg) -> ShopSession {
    let layout = Layout::draw(random);
    let count = how_many(random);
    let kinds = kinds(random, count, layout);
    let plan = Plan::draw(random, layout, kinds.contains(&Kind::Cyclic));
    let stops = plan.stops(random);
    let floor = Floor::draw(random, [0.1, 1.0], [0.03, 0.4]);
    let courses = plan.courses(&stops);
    let metric = Metric::of(&floor, &courses);
    let mut deviations = plan.noise(random, &floor, &stops, &courses);
    let mut hidden = vec![];
    for kind in kinds {
        let own = plan.hide(random, kind, &metric, &stops);
        for (sum, value) in deviations.iter_mut().zip(&own.one) {
            *sum += own.size * value;
        }
        hidden.push(own);
    }
    let effects = plan.effects(&metric, &stops, &hidden);
    let run = Run {
        axis: plan.axis,
        others_mm: plan.others_mm,
        dwell_s: plan.dwell_s,
        feed_mm_s: FEED_MM_S,
        overrun_mm: OVERRUN_MM,
    };
    let (text, map) = write(random, layout, &run, &stops, &deviations);
    ShopSession {
        shift: None,
        tables: vec![Table {
            name: "laser".to_owned(),
            text,
            map,
        }],
        machine: machine(TRAVELS_MM.map(|(letter, _)| {
            if letter == plan.axis {
                plan.lead_mm
            } else {
                10.0
            }
        })),
        truth: ShopTruth {
            session: format!("ISO 230-2 of {}", plan.axis),
            layout: layout.words().to_owned(),
            repeats: plan.cycles,
            places: plan.targets_mm.len(),
            effects,
            white_um: floor.white_um,
            between_runs_um: floor.between_runs_um,
            memory: floor.memory,
            shift: None,
        },
    }
}

/// Kinds that a session hides: one-way readings have no lost motion, and an axis one kind of it.
fn kinds(random: &mut Pcg64Mcg, count: usize, layout: Layout) -> Vec<Kind> {
    let lost = if random.random() {
        Kind::LostMotion
    } else {
        Kind::WornNut
    };
    let mut all = vec![Kind::Lead, Kind::Scale, Kind::Cyclic, Kind::Drift];
    if layout != Layout::OneWay {
        // Nearly every axis has some.
        all.extend([lost, lost]);
    }
    all.shuffle(random);
    all.dedup();
    let mut kinds: Vec<Kind> = vec![];
    for kind in all {
        if kinds.len() < count && !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    kinds
}

impl Plan {
    fn draw(random: &mut Pcg64Mcg, layout: Layout, is_fine: bool) -> Self {
        let (axis, [low, high]) = TRAVELS_MM[random.random_range(0..TRAVELS_MM.len())];
        let lead_mm = [2.0, 4.0, 5.0, 8.0, 10.0, 12.0, 16.0, 20.0][random.random_range(0..8)];
        // A run for the periodic error has close targets over a few turns; others span the travel.
        let is_fine = is_fine && random.random::<f64>() < 0.6;
        let (count, length) = if is_fine {
            let count: usize = random.random_range(25..=41);
            (
                count,
                lead_mm * random.random_range(0.08..0.2) * count as f64,
            )
        } else {
            (
                random.random_range(5..=41),
                10.0 * f64::from(random.random_range(4_u32..=46)),
            )
        };
        let room = (high - low - 20.0 - length).max(0.0);
        let from = low + 10.0 + random.random_range(0.0..=room);
        let spacing = length / (count - 1) as f64;
        let is_even = random.random();
        let target = |k: usize| {
            let is_end = k == 0 || k + 1 == count;
            let off = if is_end || is_even {
                0.0
            } else {
                random.random_range(-0.2..0.2)
            };
            ((from + spacing * (k as f64 + off)) * 1e3).round() / 1e3
        };
        let targets_mm = (0..count).map(target).collect();
        let arm = |random: &mut Pcg64Mcg| {
            let is_off = random.random::<f64>() < 0.6;
            if is_off {
                f64::from(random.random_range(40_u32..200))
            } else {
                0.0
            }
        };
        let cycles = match layout {
            Layout::OneWay | Layout::WanderingTargets | Layout::Sorted => {
                random.random_range(2..=5)
            }
            _ => random.random_range(1..=5),
        };
        Self {
            axis,
            layout,
            targets_mm,
            cycles,
            dwell_s: random.random_range(DWELL_S[0]..DWELL_S[1]).round(),
            lead_mm,
            others_mm: [arm(random), arm(random)],
        }
    }

    fn period_mm(&self, random: &mut Pcg64Mcg, kind: Kind) -> f64 {
        let is_lead = kind != Kind::Cyclic || random.random::<f64>() < 0.8;
        let factor = if is_lead {
            1.0
        } else {
            random.random_range(0.5..1.6)
        };
        self.lead_mm * factor
    }

    /// An effect at a size whose D is drawn.
    fn hide(&self, random: &mut Pcg64Mcg, kind: Kind, metric: &Metric, stops: &[Stop]) -> Hidden {
        let period_mm = self.period_mm(random, kind);
        let one = readings(random, kind, stops, period_mm);
        let d_of_one = metric.d(&in_runs(stops, &one), &[vec![1.0; stops.len()]]);
        let ([low, high], _) = kind.sizes();
        let size = (log_uniform(random, D_OF_POSITIONING) / d_of_one.max(1e-9)).clamp(low, high);
        let is_signed = kind != Kind::Cyclic;
        Hidden {
            kind,
            size: if is_signed { size * sign(random) } else { size },
            one,
            period_mm,
        }
    }

    /// The stops in the order of the measurement.
    fn stops(&self, random: &mut Pcg64Mcg) -> Vec<Stop> {
        let n = self.targets_mm.len();
        let mut order: Vec<(usize, bool, usize)> = vec![];
        if self.layout == Layout::StepCycle {
            for target in 0..n {
                for cycle in 0..self.cycles {
                    order.extend([(cycle, true, target), (cycle, false, target)]);
                }
            }
        } else {
            for cycle in 0..self.cycles {
                order.extend((0..n).map(|target| (cycle, true, target)));
                if self.layout != Layout::OneWay {
                    order.extend((0..n).rev().map(|target| (cycle, false, target)));
                }
            }
        }
        let (mut at_mm, mut time_s) = (self.targets_mm[0] - OVERRUN_MM, 0.0);
        let mut stops = vec![];
        for (cycle, is_up, target) in order {
            let off = if self.layout == Layout::WanderingTargets {
                (2.0 * random.random_range(-1.0_f64..1.0)).round() / 1e3
            } else {
                0.0
            };
            let place_mm = self.targets_mm[target] + off;
            let turns = 2.0 * OVERRUN_MM / FEED_MM_S;
            time_s += (place_mm - at_mm).abs() / FEED_MM_S + self.dwell_s + turns;
            at_mm = place_mm;
            stops.push(Stop {
                cycle,
                is_up,
                target,
                place_mm,
                time_s,
            });
        }
        stops
    }

    /// The course of each cycle's readings along the travel.
    fn courses(&self, stops: &[Stop]) -> Vec<Vec<f64>> {
        let (low, high) = (
            self.targets_mm[0],
            self.targets_mm[self.targets_mm.len() - 1],
        );
        let of = |cycle: usize| {
            let own = stops.iter().filter(|stop| stop.cycle == cycle);
            own.map(|stop| (stop.place_mm - low) / (high - low))
                .collect()
        };
        (0..self.cycles).map(of).collect()
    }

    fn noise(
        &self,
        random: &mut Pcg64Mcg,
        floor: &Floor,
        stops: &[Stop],
        courses: &[Vec<f64>],
    ) -> Vec<f64> {
        let mut runs: Vec<_> = courses
            .iter()
            .map(|c| floor.run(random, c).into_iter())
            .collect();
        let of = |stop: &Stop| runs[stop.cycle].next().unwrap_or_default();
        stops.iter().map(of).collect()
    }

    /// Turns of the axis that the beam reads as a position. The tool is read on the table, which X' carries and Y' carries both: in
    /// the frame of X' it stands off by Y and Z, in that of Y' by Z alone, and Z carries it on its own line.
    fn turns(&self) -> Vec<Name> {
        let [first_mm, second_mm] = self.others_mm;
        let with_arms: &[(&str, f64)] = match self.axis {
            "X" => &[("CX", first_mm), ("BX", second_mm)],
            "Y" => &[("AY", second_mm)],
            _ => &[],
        };
        let read = with_arms.iter().filter(|(_, arm_mm)| arm_mm.abs() > 0.0);
        read.map(|(letters, _)| name("angular_error", letters))
            .collect()
    }

    /// What is true of every hidden effect.
    fn effects(&self, metric: &Metric, stops: &[Stop], hidden: &[Hidden]) -> Vec<ShopEffect> {
        let (axis, zero) = (self.axis, vec![1.0; stops.len()]);
        let of = |(place, own): (usize, &Hidden)| {
            let readings: Vec<f64> = own.one.iter().map(|value| own.size * value).collect();
            let readings = in_runs(stops, &readings);
            let others = || { hidden.iter().enumerate() }.filter(|(k, _)| *k != place);
            let mut taken_out: Vec<Vec<f64>> = vec![zero.clone()];
            taken_out.extend(others().map(|(_, other)| in_runs(stops, &other.one)));
            let d_alone = metric.d(&readings, &taken_out);
            let mut same = self.same_readings(own);
            same.extend(self.in_course(own.kind, metric, stops, &readings));
            if d_alone < MIN_D_APART {
                same.extend(others().map(|(_, other)| name(other.kind.id(), axis)));
            }
            let has_slope = own.kind == Kind::Lead;
            ShopEffect {
                what: own.kind.words().to_owned(),
                names: vec![name(own.kind.id(), axis)],
                besides: if has_slope {
                    vec![name("scale_error", axis)]
                } else {
                    vec![]
                },
                same_readings: same,
                size: own.size,
                unit: own.kind.sizes().1.to_owned(),
                d: metric.d(&readings, std::slice::from_ref(&zero)),
                d_alone,
                follow: None,
                parameter: None,
                change: None,
            }
        };
        hidden.iter().enumerate().map(of).collect()
    }

    /// Other effects that would read the same, whatever else is hidden.
    fn same_readings(&self, own: &Hidden) -> Vec<Name> {
        match own.kind {
            Kind::Lead => self.turns(),
            Kind::Scale => {
                let mut same = self.turns();
                same.push(name("length_wavelength", ""));
                same
            }
            Kind::LostMotion | Kind::WornNut => vec![name("feed_lost_motion", self.axis)],
            Kind::Cyclic if !resolves(&self.targets_mm, own.period_mm) => {
                vec![name("pitch_error", self.axis)]
            }
            Kind::Cyclic | Kind::Drift => vec![],
        }
    }
}

/// Time constants of drifts and of a spindle's growth that a course in time may be, s.
const RELAXES_S: [f64; 7] = [30.0, 60.0, 240.0, 480.0, 960.0, 2400.0, 6000.0];

impl Plan {
    /// What reads the same because time and place go together: a drift and an error of the place.
    fn in_course(
        &self,
        kind: Kind,
        metric: &Metric,
        stops: &[Stop],
        readings: &[f64],
    ) -> Vec<Name> {
        let axis = self.axis;
        let is_alike = |mut rivals: Vec<Vec<f64>>| {
            rivals.push(vec![1.0; stops.len()]);
            metric.d(readings, &rivals) < MIN_D_APART
        };
        let of_stops = |of: &dyn Fn(&Stop) -> f64| -> Vec<f64> {
            let values: Vec<f64> = stops.iter().map(of).collect();
            in_runs(stops, &values)
        };
        let relaxing = || -> Vec<Vec<f64>> {
            let relaxed = RELAXES_S.map(|s| of_stops(&|stop| 1.0 - (-stop.time_s / s).exp()));
            relaxed.to_vec()
        };
        let targets = 0..self.targets_mm.len();
        let is_sorted = matches!(self.layout, Layout::Sorted | Layout::StepCycle);
        match kind {
            // A sheet that is sorted by target may be of a step cycle.
            Kind::Lead | Kind::Scale if is_sorted => vec![name("ambient_drift", axis)],
            Kind::Lead | Kind::Scale => {
                let mut courses = relaxing();
                courses.push(of_stops(&|stop| stop.time_s));
                courses.push(of_stops(&|stop| stop.time_s.powi(2)));
                if is_alike(courses) {
                    vec![name("ambient_drift", axis)]
                } else {
                    vec![]
                }
            }
            Kind::Drift => {
                let at = |target: usize| {
                    of_stops(&move |stop| f64::from(u8::from(stop.target == target)))
                };
                let side = |target: usize| {
                    of_stops(&move |stop| f64::from(u8::from(stop.target == target && stop.is_up)))
                };
                let mut same = vec![];
                if is_alike(targets.clone().map(at).collect()) {
                    same.extend([name("pitch_error", axis), name("scale_error", axis)]);
                } else if is_alike(targets.clone().map(at).chain(targets.map(side)).collect()) {
                    same.push(name("backlash", axis));
                }
                if axis == "Z" && is_alike(relaxing()) {
                    same.push(name("spindle_growth", ""));
                }
                same
            }
            Kind::LostMotion | Kind::WornNut | Kind::Cyclic => vec![],
        }
    }
}

/// Values at the stops, ordered by cycle as the metric has them.
fn in_runs(stops: &[Stop], values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..stops.len()).collect();
    order.sort_by_key(|k| stops[*k].cycle);
    order.into_iter().map(|k| values[k]).collect()
}

/// A machine file with what an importer needs.
pub fn machine(leads_mm: [f64; 3]) -> String {
    let mut text = "name: shop\nchain: \"[w X' Y' b Z t]\"\naxes:\n".to_owned();
    for ((letter, [low, high]), lead_mm) in TRAVELS_MM.into_iter().zip(leads_mm) {
        text += &format!(
            "  {letter}: {{travel_mm: [{low:.1}, {high:.1}], feed_limit_mm_min: 20000.0, acceleration_limit_mm_s2: 3000.0, \
             lead_mm: {lead_mm:.1}, position_gain_per_s: 60.0, velocity_feedforward: 0.98, encoder_resolution_um: 0.05}}\n"
        );
    }
    text + "control: {servo_period_ms: 1.0, pulse_equivalent_um: 0.1, latch: hardware}\n\
        probe: {styli: {a: {radius_mm: 3.0, length_mm: 50.0}}, mounted: a, standoff_mm: 2.0, overtravel_mm: 3.0, \
        feed_mm_min: 120.0, repeatability_um: 0.3}\n"
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    /// By hand, for the chain of `machine`: Z carries the tool on its own line, and where X' stands is no arm of Y'.
    #[test]
    fn a_turn_is_read_where_the_chain_gives_it_an_arm() {
        let turns = |axis, others_mm| {
            let plan = Plan {
                axis,
                layout: Layout::OneWay,
                targets_mm: vec![0.0, 10.0],
                cycles: 1,
                dwell_s: 2.0,
                lead_mm: 10.0,
                others_mm,
            };
            let names = plan.turns().into_iter().map(|(_, letters)| letters);
            names.collect::<Vec<String>>()
        };
        assert_eq!(turns("X", [50.0, 80.0]), ["CX", "BX"]);
        assert_eq!(turns("X", [0.0, 80.0]), ["BX"]);
        assert_eq!(turns("Y", [50.0, 80.0]), ["AY"]);
        assert!(turns("Y", [50.0, 0.0]).is_empty());
        assert!(turns("Z", [50.0, 80.0]).is_empty());
    }

    /// One cycle from one side goes with time as it goes along the axis; five do not, but a sheet of them may be of a step cycle.
    #[test]
    fn time_and_place_go_together_in_one_cycle_and_in_a_step_cycle() {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut same = |layout, cycles, kind| -> Vec<String> {
            let plan = Plan {
                axis: "X",
                layout,
                targets_mm: (0..21).map(|k| 20.0 * f64::from(k)).collect(),
                cycles,
                dwell_s: 4.0,
                lead_mm: 10.0,
                others_mm: [0.0; 2],
            };
            let stops = plan.stops(&mut random);
            let floor = Floor::draw(&mut random, [0.2, 0.2], [0.1, 0.1]);
            let metric = Metric::of(&floor, &plan.courses(&stops));
            let slope = |stop: &Stop| 0.05 * stop.place_mm;
            let risen = |stop: &Stop| 5.0 * (1.0 - (-stop.time_s / 300.0).exp());
            let readings: Vec<f64> = match kind {
                Kind::Drift => stops.iter().map(risen).collect(),
                _ => stops.iter().map(slope).collect(),
            };
            let names = plan.in_course(kind, &metric, &stops, &in_runs(&stops, &readings));
            names.into_iter().map(|(id, _)| id).collect()
        };
        let of_place = ["pitch_error", "scale_error"];
        assert_eq!(same(Layout::OneWay, 1, Kind::Drift), of_place);
        assert_eq!(same(Layout::OneWay, 1, Kind::Scale), ["ambient_drift"]);
        assert_eq!(same(Layout::Long, 5, Kind::Drift), [""; 0]);
        assert_eq!(same(Layout::Long, 5, Kind::Scale), [""; 0]);
        assert_eq!(same(Layout::StepCycle, 4, Kind::Drift), of_place);
        assert_eq!(same(Layout::Sorted, 4, Kind::Drift), [""; 0]);
        assert_eq!(same(Layout::Sorted, 4, Kind::Scale), ["ambient_drift"]);
    }
}
