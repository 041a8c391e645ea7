//! Arm s3: logs of a displacement sensor with thermometers: warm-ups, cycles, a day at rest.

use std::fmt::Write as _;

use rand::Rng;
use rand::seq::{IndexedRandom, SliceRandom};
use rand_pcg::Pcg64Mcg;

use super::dice::{heavy, how_many, log_uniform, sign};
use super::heat::{Behind, Course, KEPT_S, Load, Node, blocks, lagged};
use super::layout::START_S;
use super::metric::{Floor, Metric};
use super::truth::{Follow, Name, ShopEffect, ShopTruth, name};
use super::{ShopSession, Table};

/// D of hidden effects.
const D_OF_LOGS: [f64; 2] = [5.0, 400.0];
/// Range of lags, min.
const LAG_MIN: [f64; 2] = [2.0, 120.0];
/// Range of growth, µm/K.
const GROWTH_UM_PER_K: [f64; 2] = [0.1, 20.0];
/// Below this D apart from an alternative both make the same readings.
const MAX_D_OF_SAME: f64 = 3.0;
/// Lags of alternatives, min.
const TRIED_MIN: [f64; 11] = [
    0.0, 2.0, 4.0, 8.0, 15.0, 25.0, 40.0, 65.0, 100.0, 160.0, 250.0,
];
/// Readings at which alternatives are compared.
const MOST_COMPARED: usize = 500;
/// Noise of a thermometer, K.
const THERMOMETER_NOISE_K: f64 = 0.02;

/// Kinds of sessions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Once,
    Mornings,
    Cycles,
    Day,
}

impl Kind {
    const fn words(self) -> &'static str {
        match self {
            Self::Once => "one warm-up",
            Self::Mornings => "several mornings",
            Self::Cycles => "cycles one after another",
            Self::Day => "a day at rest",
        }
    }
}

/// When a session was read.
struct Times {
    kind: Kind,
    /// Length of all, s.
    whole_s: f64,
    /// Kept instants of each run.
    runs: Vec<Vec<usize>>,
}

/// A thermometer: its name, place and the node that it is on.
struct Sensor {
    id: String,
    place: &'static str,
    node: Node,
    degc: Vec<f64>,
}

/// What grows.
struct Hidden {
    node: Node,
    um_per_k: f64,
    /// Displacement for 1 µm/K, at every kept instant.
    one: Vec<f64>,
}

/// Draws a session.
pub fn draw(random: &mut Pcg64Mcg) -> ShopSession {
    let kinds = [
        Kind::Once,
        Kind::Mornings,
        Kind::Mornings,
        Kind::Cycles,
        Kind::Day,
    ];
    let kind = *kinds.choose(random).unwrap_or(&Kind::Once);
    let times = Times::draw(random, kind);
    let axis = if random.random::<f64>() < 0.6 {
        "Z"
    } else {
        ["X", "Y"][random.random_range(0..2)]
    };
    let load = times.load(random);
    let course = Course::of(random, &load);
    let count = how_many(random);
    let nodes = hidden_nodes(random, times.kind, axis, count);
    let sensors = sensors(random, &course, &nodes, axis);
    let floor = draw_floor(random);
    let metric = Metric::of(&floor, &times.courses());
    let of = |node| hide(random, node, &course, &times, &metric);
    let hidden: Vec<Hidden> = nodes.into_iter().map(of).collect();
    let text = table(random, &times, &sensors, &hidden, &floor);
    let effects = { 0..hidden.len() }
        .map(|own| effect(&times, &sensors, &hidden, own, axis, &floor))
        .collect();
    ShopSession {
        shift: None,
        tables: vec![Table {
            name: "log".to_owned(),
            text,
            map: map(&times, &sensors, axis),
        }],
        machine: machine(&sensors),
        truth: ShopTruth {
            session: format!("log of {axis}: {}", times.kind.words()),
            layout: if times.has_runs() {
                "numbered runs"
            } else {
                "one log"
            }
            .to_owned(),
            repeats: times.runs.len(),
            places: sensors.len(),
            effects,
            white_um: floor.white_um,
            between_runs_um: floor.between_runs_um,
            memory: floor.memory,
            shift: None,
        },
    }
}

/// Noise of a log: in half of them neighbouring readings share a part of it.
fn draw_floor(random: &mut Pcg64Mcg) -> Floor {
    let has_memory = random.random::<bool>();
    let memory = if has_memory {
        random.random_range(0.2..0.8)
    } else {
        0.0
    };
    Floor::draw(random, [0.05, 0.5], [0.02, 0.15]).with_memory(memory)
}

/// Growth by a node, lagged by a drawn time, at a size whose D is drawn.
fn hide(
    random: &mut Pcg64Mcg,
    node: Node,
    course: &Course,
    times: &Times,
    metric: &Metric,
) -> Hidden {
    let face = course.at(node);
    let lag_s = 60.0 * log_uniform(random, LAG_MIN);
    let behind = Behind::draw(random, lag_s);
    let mean = behind.mean(&face);
    let one: Vec<f64> = mean.iter().map(|value| value - face[0]).collect();
    let d_of_one = metric.d(&times.pick(&one), &[vec![1.0; metric.len()]]);
    let [low, high] = GROWTH_UM_PER_K;
    let size = (log_uniform(random, D_OF_LOGS) / d_of_one.max(1e-9)).clamp(low, high);
    Hidden {
        node,
        um_per_k: sign(random) * size,
        one,
    }
}

/// What grows: the spindle along Z alone, in a day at rest the room alone; each node once.
fn hidden_nodes(random: &mut Pcg64Mcg, kind: Kind, axis: &str, count: usize) -> Vec<Node> {
    let mut all = match (kind, axis) {
        (Kind::Day, _) => vec![Node::Room],
        (_, "Z") => vec![
            Node::Front,
            Node::Front,
            Node::Rear,
            Node::Column,
            Node::Nut,
            Node::Room,
        ],
        _ => vec![Node::Column, Node::Nut, Node::Room],
    };
    all.shuffle(random);
    let mut nodes: Vec<Node> = vec![];
    for node in all {
        if nodes.len() < count && !nodes.contains(&node) {
            nodes.push(node);
        }
    }
    nodes
}

impl Times {
    fn draw(random: &mut Pcg64Mcg, kind: Kind) -> Self {
        let every: usize = [2, 3, 6][random.random_range(0..3)];
        let hours =
            |random: &mut Pcg64Mcg, [low, high]: [f64; 2]| random.random_range(low..high) * 3600.0;
        let (count, length_s, period_s) = match kind {
            Kind::Once => {
                let length_s = hours(random, [3.0, 8.0]);
                (1, length_s, length_s)
            }
            Kind::Mornings => (
                random.random_range(2..=6),
                hours(random, [1.5, 4.0]),
                86_400.0,
            ),
            Kind::Cycles => {
                let length_s = hours(random, [1.5, 3.0]);
                (random.random_range(3..=6), length_s, length_s)
            }
            Kind::Day => (1, 86_400.0, 86_400.0),
        };
        let every = if kind == Kind::Day { 3 * every } else { every };
        let run = |k: usize| {
            let from = (k as f64 * period_s / KEPT_S).round() as usize;
            let to = from + (length_s / KEPT_S).round() as usize;
            (from..to).step_by(every).collect()
        };
        Self {
            kind,
            whole_s: (count - 1) as f64 * period_s + length_s + 600.0,
            runs: (0..count).map(run).collect(),
        }
    }

    const fn has_runs(&self) -> bool {
        matches!(self.kind, Kind::Mornings | Kind::Cycles)
    }

    /// Spindle and axis work while the machine is logged; in cycles it cools in the second half of each.
    fn load(&self, random: &mut Pcg64Mcg) -> Load {
        let steps = self.whole_s as usize;
        let mut load = Load {
            spindle: vec![0.0; steps],
            axis: vec![0.0; steps],
        };
        if self.kind == Kind::Day {
            return load;
        }
        let is_even = random.random::<f64>() < 0.3;
        for run in &self.runs {
            let [from, to] = [run[0], run[run.len() - 1]].map(|k| (k as f64 * KEPT_S) as usize);
            let share = match self.kind {
                Kind::Cycles => 0.5,
                _ => random.random_range(0.6..1.0),
            };
            let length = ((to - from) as f64 * share) as usize;
            let [spindle, axis] = [(); 2].map(|()| {
                if is_even {
                    vec![0.8; length]
                } else {
                    blocks(random, length, [400.0, 5000.0])
                }
            });
            load.spindle[from..from + length].copy_from_slice(&spindle);
            load.axis[from..from + length].copy_from_slice(&axis);
        }
        load
    }

    /// Values at the readings.
    fn pick(&self, kept: &[f64]) -> Vec<f64> {
        self.runs.iter().flatten().map(|k| kept[*k]).collect()
    }

    fn courses(&self) -> Vec<Vec<f64>> {
        let of = |run: &Vec<usize>| {
            let last = (run.len() - 1).max(1) as f64;
            (0..run.len()).map(|k| k as f64 / last).collect()
        };
        self.runs.iter().map(of).collect()
    }

    /// Every so many of the readings, as many as are compared.
    fn thinned(&self) -> (Self, usize) {
        let all: usize = self.runs.iter().map(Vec::len).sum();
        let every = all.div_ceil(MOST_COMPARED);
        let thin = |run: &Vec<usize>| run.iter().copied().step_by(every).collect();
        let thinned = Self {
            kind: self.kind,
            whole_s: self.whole_s,
            runs: self.runs.iter().map(thin).collect(),
        };
        (thinned, every)
    }
}

const fn place(node: Node, axis: &str) -> &'static str {
    match (node, axis.as_bytes()[0]) {
        (Node::Front, _) => "spindle_front",
        (Node::Rear, _) => "spindle_rear",
        (Node::Column, _) => "column",
        (Node::Bed, _) => "bed",
        (Node::Nut, b'X') => "nut_x",
        (Node::Nut, b'Y') => "nut_y",
        (Node::Nut, _) => "nut_z",
        (Node::Room, _) => "ambient",
    }
}

/// Thermometers: one on each node that something follows, and others, 2 to 12 together.
fn sensors(random: &mut Pcg64Mcg, course: &Course, hidden: &[Node], axis: &str) -> Vec<Sensor> {
    let count = (log_uniform(random, [2.0, 13.0]) as usize)
        .max(hidden.len())
        .min(12);
    let mut nodes = hidden.to_vec();
    let all = [
        Node::Front,
        Node::Rear,
        Node::Column,
        Node::Bed,
        Node::Nut,
        Node::Room,
    ];
    while nodes.len() < count {
        let node = all[random.random_range(0..all.len())];
        let is_single = matches!(node, Node::Front | Node::Rear | Node::Nut);
        if !(is_single && nodes.contains(&node)) {
            nodes.push(node);
        }
    }
    let mut found: Vec<Sensor> = vec![];
    for node in nodes {
        let place = place(node, axis);
        let before = found.iter().filter(|sensor| sensor.node == node).count();
        let id = if before == 0 {
            place.to_owned()
        } else {
            format!("{place}_{}", before + 1)
        };
        let (own, bed) = (course.at(node), course.at(Node::Bed));
        // Others of one place stand elsewhere: a part of what they read is the bed's.
        let share = if before == 0 {
            0.0
        } else {
            random.random_range(0.1..0.5)
        };
        let degc = own
            .iter()
            .zip(&bed)
            .map(|(own, bed)| own + share * (bed - own))
            .collect();
        found.push(Sensor {
            id,
            place,
            node,
            degc,
        });
    }
    found
}

fn table(
    random: &mut Pcg64Mcg,
    times: &Times,
    sensors: &[Sensor],
    hidden: &[Hidden],
    floor: &Floor,
) -> String {
    let ids: Vec<&str> = sensors.iter().map(|sensor| sensor.id.as_str()).collect();
    let run = if times.has_runs() { "run," } else { "" };
    let mut text = format!("{run}time_s,displacement_um,{}\n", ids.join(","));
    for (number, (kept, course)) in times.runs.iter().zip(times.courses()).enumerate() {
        let noise = floor.run(random, &course);
        for (k, noise_um) in kept.iter().zip(noise) {
            let grown: f64 = hidden.iter().map(|own| own.um_per_k * own.one[*k]).sum();
            if times.has_runs() {
                let _ = write!(text, "{},", number + 1);
            }
            let _ = write!(text, "{:.0},{:.3}", *k as f64 * KEPT_S, grown + noise_um);
            for sensor in sensors {
                let read = sensor.degc[*k] + THERMOMETER_NOISE_K * heavy(random);
                let _ = write!(text, ",{read:.2}");
            }
            text.push('\n');
        }
    }
    text
}

fn map(times: &Times, sensors: &[Sensor], axis: &str) -> String {
    let cause = match times.kind {
        Kind::Day => ", cause: environment",
        _ => "",
    };
    let columns: Vec<String> = { sensors.iter() }
        .map(|sensor| format!("{0}: {0}", sensor.id))
        .collect();
    let run = if times.has_runs() { "run: run, " } else { "" };
    format!(
        "start_s: {START_S}\nat_mm: {{X: 0.0, Y: 0.0, Z: 100.0}}\ntest:\n  log: {{axis: {axis}{cause}, {run}time_s: time_s, \
         displacement_um: displacement_um, temperature_degc: {{{}}}}}\n",
        columns.join(", ")
    )
}

fn machine(sensors: &[Sensor]) -> String {
    let mut text = super::positioning::machine([10.0; 3]) + "temperature_sensors:\n";
    for Sensor { id, place, .. } in sensors {
        let _ = writeln!(text, "  - {{id: {id}, place: {place}, period_s: 60.0}}");
    }
    text
}

/// Names of the catalogue for growth that follows a node.
fn names(sensors: &[Sensor], node: Node, axis: &str) -> Vec<Name> {
    let has_front = sensors.iter().any(|sensor| sensor.node == Node::Front);
    let own = sensors.iter().filter(|sensor| sensor.node == node);
    let shifts = own.map(|sensor| name("thermal_shift", &sensor.id));
    let mut names = match node {
        Node::Front => vec![name("spindle_growth", "")],
        Node::Rear if has_front => vec![name("spindle_growth", "spindle_rear")],
        Node::Rear => vec![name("spindle_growth", "")],
        Node::Column => vec![name("column_bend", "")],
        Node::Bed | Node::Room => vec![name("ambient_drift", axis), name("column_bend", "")],
        Node::Nut => vec![],
    };
    names.extend(shifts);
    names
}

fn effect(
    times: &Times,
    sensors: &[Sensor],
    hidden: &[Hidden],
    own: usize,
    axis: &str,
    floor: &Floor,
) -> ShopEffect {
    let (times, every) = times.thinned();
    let floor = floor.thinned(every);
    let metric = Metric::of(&floor, &times.courses());
    let Hidden {
        node,
        um_per_k,
        one,
    } = &hidden[own];
    let readings: Vec<f64> = times
        .pick(one)
        .iter()
        .map(|value| um_per_k * value)
        .collect();
    let zero = vec![1.0; metric.len()];
    let mut taken_out = vec![zero.clone()];
    let others = hidden.iter().enumerate().filter(|(k, _)| *k != own);
    taken_out.extend(others.map(|(_, other)| times.pick(&other.one)));
    let d_alone = metric.d(&readings, &taken_out);
    let own_names = names(sensors, *node, axis);
    let mut same: Vec<Name> = vec![];
    for sensor in sensors.iter().filter(|sensor| sensor.node != *node) {
        let is_same = |lag_min: &f64| {
            let column = times.pick(&lagged(&sensor.degc, 60.0 * lag_min));
            let with = [&taken_out[..], &[column]].concat();
            metric.d(&readings, &with) < MAX_D_OF_SAME
        };
        if TRIED_MIN.iter().any(is_same) {
            same.extend(names(sensors, sensor.node, axis));
        }
    }
    same.retain(|other| !own_names.contains(other));
    same.sort();
    same.dedup();
    let thermometer = sensors.iter().find(|sensor| sensor.node == *node);
    ShopEffect {
        what: words(*node).to_owned(),
        names: own_names,
        besides: vec![],
        same_readings: same,
        size: *um_per_k,
        unit: "µm/K".to_owned(),
        d: metric.d(&readings, std::slice::from_ref(&zero)),
        d_alone,
        follow: thermometer.map(|sensor| follow(&times, sensor, &readings)),
        parameter: None,
        change: None,
    }
}

const fn words(node: Node) -> &'static str {
    match node {
        Node::Front => "spindle, front bearing",
        Node::Rear => "spindle, rear bearing",
        Node::Column => "column",
        Node::Bed => "bed",
        Node::Nut => "screw",
        Node::Room => "air",
    }
}

/// The lag of first order, and its size, that describe noiseless readings best.
fn follow(times: &Times, sensor: &Sensor, readings: &[f64]) -> Follow {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let of = |lag_min: f64| -> (f64, f64) {
        let column = times.pick(&lagged(&sensor.degc, 60.0 * lag_min));
        let (x0, y0) = (mean(&column), mean(readings));
        let pairs = || column.iter().zip(readings);
        let across: f64 = pairs().map(|(x, y)| (x - x0) * (y - y0)).sum();
        let square: f64 = column.iter().map(|x| (x - x0).powi(2)).sum();
        let um_per_k = across / square.max(1e-12);
        let left = pairs()
            .map(|(x, y)| (y - y0 - um_per_k * (x - x0)).powi(2))
            .sum();
        (left, um_per_k)
    };
    let mut lag_min = 0.5;
    let mut best = (
        f64::MAX,
        Follow {
            thermometer: sensor.id.clone(),
            lag_min,
            um_per_k: 0.0,
        },
    );
    while lag_min < 400.0 {
        let (left, um_per_k) = of(lag_min);
        if left < best.0 {
            best = (
                left,
                Follow {
                    thermometer: sensor.id.clone(),
                    lag_min,
                    um_per_k,
                },
            );
        }
        lag_min *= 1.03;
    }
    best.1
}
