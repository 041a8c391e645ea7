//! Recordings to which one effect is added: the commands, stamps, touches and temperatures of a programme that the plant has
//! run, with readings that are noise alone.

use std::f64::consts::TAU;

use fake_cnc::PlantFile;
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use machine::MachineFile;
use machine::file::{ArtefactEntry, SensorEntry, SensorPlace};
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use sequencer::{Plan, Step};
use trials::{Arm, Rig, Sample, Trial, measure};
use twin::{Channel, Run, Session};

const ROTARY: &str = "title: two spheres
steps:
  - {do: latency, feature: top, feeds_mm_min: [60.0, 120.0, 240.0, 480.0], repeats: 6}
  - {do: artefact, id: high, points: 25}
  - {do: rotary, sphere: high, planned: 16, points: 6, repeats: 3}
  - {do: artefact, id: high, points: 25}
  - {do: rotary, sphere: low, planned: 16, points: 6, repeats: 3}
  - {do: artefact, id: high, points: 25}
  - {do: rotary, sphere: high, planned: 8, points: 6, verification: true}
";

/// A recording and the machine that it is of.
pub struct Recording {
    pub title: &'static str,
    pub machine: MachineFile,
    pub session: Session,
}

/// The air conditioning of a warm shop: its swing, K, and its period, s.
const CONDITIONING: [f64; 2] = [1.5, 720.0];
/// The same beside a gate that was opened.
const GATE: [f64; 2] = [5.0, 9000.0];

/// Circles, positioning and touches of three axes; the same in a warm shop with two thermometers in the air that its air
/// conditioning swings; two spheres on rotary axes; a short beam along X; a ring gauge in a shop whose gate was opened.
pub fn recordings() -> Vec<Recording> {
    let mut rig = Trial::draw(Arm::Null, 5, 0).unwrap().rig;
    rig.has_motors = true;
    let (warm, rotary) = (warm_shop(&rig), five_axis(&rig));
    let short = short_beam(&rig);
    vec![
        recording("circles", &rig, input),
        recording("warm shop", &warm, conditioned),
        recording("spheres", &rotary, input),
        recording("short beam", &short, input),
        recording("ring gauge", &ring_gauge(&warm), beside_a_gate),
    ]
}

/// How often the ring is touched, how long is waited before each, s, and its radius, mm.
///
/// Of so many repeats what changes slowly is told from noise.
const RINGS: usize = 15;
const BETWEEN_RINGS_S: f64 = 150.0;
const RING_MM: f64 = 120.0;

/// The programme of a shop, and a ring gauge that is touched again and again.
fn ring_gauge(like: &Rig) -> Rig {
    let mut rig = like.clone();
    let id = "ring".to_owned();
    for file in [&mut rig.machine, &mut rig.control] {
        file.artefacts.push(ArtefactEntry::Bore {
            id: id.clone(),
            centre_mm: [0.0, 0.0, -30.0],
            radius_mm: RING_MM,
        });
    }
    for _ in 0..RINGS {
        let (id, seconds) = (id.clone(), BETWEEN_RINGS_S);
        rig.plan.steps.push(Step::Wait { seconds });
        rig.plan.steps.push(Step::Artefact { id, points: 24 });
    }
    rig
}

/// Half the way of a short beam, mm.
const SHORT_BEAM_MM: f64 = 100.0;

/// The programme of a shop whose length reference sees a part of X only: a beam that meets its receiver leans more there.
fn short_beam(like: &Rig) -> Rig {
    let mut rig = like.clone();
    for file in [&mut rig.machine, &mut rig.control] {
        let beam = &mut file.length_reference.as_mut().unwrap().beams[0];
        (beam.from_mm[0], beam.to_mm[0]) = (-SHORT_BEAM_MM, SHORT_BEAM_MM);
    }
    for step in &mut rig.plan.steps {
        if let Step::Positioning(of) = step
            && of.axis == Axis::X
        {
            let last = SHORT_BEAM_MM - 10.0;
            (of.from_mm, of.to_mm, of.spacing_mm) = (Some(-last), Some(last), Some(0.1 * last));
        }
    }
    rig
}

fn warm_shop(like: &Rig) -> Rig {
    let mut rig = like.clone();
    let air = &mut rig.plant.heat.shop_air;
    (air.start_temp_degc, air.draught_k) = (27.0, 0.0);
    for file in [&mut rig.machine, &mut rig.control] {
        let mut sensors = file.temperature_sensors.iter_mut();
        let ambient = sensors.find(|s| s.place == SensorPlace::Ambient).unwrap();
        // A circle takes seconds.
        ambient.period_s = 0.5;
        let second = SensorEntry {
            id: "ambient_2".to_owned(),
            ..ambient.clone()
        };
        file.temperature_sensors.push(second);
    }
    rig
}

/// The five-axis machine of `launch_configs`.
fn five_axis(like: &Rig) -> Rig {
    let machine = include_str!("../../../../../../launch_configs/five_axis/machine.yaml");
    let plant = include_str!("../../../../../../launch_configs/five_axis/plant.yaml");
    let machine = MachineFile::parse(machine, "five_axis/machine.yaml").unwrap();
    Rig {
        control: machine.clone(),
        machine,
        plant: PlantFile::from_yaml(plant).unwrap(),
        plan: Plan::from_yaml(ROTARY).unwrap(),
        ..like.clone()
    }
}

fn recording(title: &'static str, rig: &Rig, heard: fn(Sample) -> Input) -> Recording {
    let mut builder = SessionBuilder::new(&rig.machine, SessionConfig::default()).unwrap();
    builder.next_bag();
    measure(rig, &mut |_, sample| builder.take(heard(sample))).unwrap();
    builder.end_bag();
    let (mut session, _) = builder.finish().unwrap();
    for run in &mut session.runs {
        scatter(run);
    }
    Recording {
        title,
        machine: rig.machine.clone(),
        session,
    }
}

fn conditioned(sample: Sample) -> Input {
    in_air(sample, CONDITIONING)
}

fn beside_a_gate(sample: Sample) -> Input {
    in_air(sample, GATE)
}

/// As it is in air that goes up and down.
fn in_air(sample: Sample, [swing_k, period_s]: [f64; 2]) -> Input {
    let mut heard = input(sample);
    if let Input::Temperature(sample) = &mut heard
        && sample.sensor.starts_with("ambient")
    {
        let turns = sample.at.as_secs_f64() / period_s;
        sample.temperature_degc += swing_k * (TAU * turns).sin();
    }
    heard
}

fn input(sample: Sample) -> Input {
    match sample {
        Sample::State(sample) => Input::State(sample),
        Sample::Grid(sample) => Input::Grid(sample),
        Sample::Length(sample) => Input::Length(sample),
        Sample::Trigger(sample) => Input::Trigger(sample),
        Sample::Temperature(sample) => Input::Temperature(sample),
        Sample::Segment(sample) => Input::Segment(sample),
    }
}

/// White noise, and waves over the place that are drawn anew for each run.
fn scatter(run: &mut Run) {
    let mut random = Pcg64Mcg::seed_from_u64(7 ^ u64::from(run.segment.run) << 20);
    let waves: Vec<(Vector3<f64>, Vector3<f64>, Vector3<f64>)> = (0..6)
        .map(|_| {
            let rad_per_mm = Vector3::from_fn(|_, _| random.random_range(-0.02..0.02));
            let phase = Vector3::from_fn(|_, _| random.random_range(0.0..TAU));
            let size_mm = Vector3::from_fn(|_, _| 1e-4 * random.sample::<f64, _>(StandardNormal));
            (rad_per_mm, phase, size_mm)
        })
        .collect();
    for reading in &mut run.readings {
        let place_mm = if reading.channel == Channel::Touch {
            run.touches[reading.at].position.xyz()
        } else {
            let at = |axis| run.motion.position[axis].get(reading.at).copied();
            PerAxis::from_fn(|axis| at(axis).unwrap_or(0.0)).xyz()
        };
        let direction = match &reading.channel {
            Channel::GridU => 0,
            Channel::GridV => 1,
            Channel::Length(axis) => axis.index() % 3,
            _ => 2,
        };
        let smooth_mm: f64 = waves
            .iter()
            .map(|(k, phase, size)| size[direction] * (k.dot(&place_mm) + phase[direction]).cos())
            .sum();
        let white: f64 = random.sample(StandardNormal);
        reading.deviation = match &reading.channel {
            Channel::Motor(axis) | Channel::Scale(axis) if axis.is_linear() => 3e-5 * white,
            Channel::Motor(_) | Channel::Scale(_) => 3e-7 * white,
            Channel::Thermometer(_) => 0.02 * white,
            Channel::Touch => 3e-4 * white + smooth_mm,
            _ => 1.5e-4 * white + smooth_mm,
        };
    }
}
