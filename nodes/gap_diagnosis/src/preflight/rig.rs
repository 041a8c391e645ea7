//! Circles of an ideal machine, for tests.

use super::{AssumedFloor, Floors};
use crate::session::{Input, SessionBuilder, SessionConfig};
use machine::MachineFile;
use metrology::sample::{AxisState, GridSample, Sense, TestKind, TestPlane, TestSegment};
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use nalgebra::Vector3;
use twin::{Instrument, Session};

const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");

/// Circles of some radii, both senses, on an ideal machine, so often.
pub fn circles(machine: &MachineFile, radii_mm: &[f64], repeats: u32) -> Session {
    let mut builder = SessionBuilder::new(machine, SessionConfig::default()).expect("a chain");
    let (mut nanos, mut run) = (0_i64, 0);
    for (radius_mm, sign) in radii_mm.iter().flat_map(|r| [(*r, 1.0), (*r, -1.0)]) {
        for repeat in 0..repeats {
            run += 1;
            let segment = |begin| TestSegment {
                at: Stamp::from_nanos(0),
                run,
                begin,
                kind: TestKind::Circle,
                plane: TestPlane::Xy,
                centre_mm: Vector3::new(0.0, 0.0, 30.0),
                radius_mm,
                feed_mm_s: 25.0,
                sense: if sign > 0.0 {
                    Sense::CounterClockwise
                } else {
                    Sense::Clockwise
                },
                repeat,
                stylus: String::new(),
                tool_offset_mm: Vector3::zeros(),
                stations: 0,
                zero_id: 1,
                setup_id: 1,
                cold: false,
                features: vec![],
                completed: true,
            };
            builder.take(Input::Segment(segment(true)));
            let mut angle = 0.0_f64;
            while angle < 1.3 * std::f64::consts::TAU {
                let at = Stamp::from_nanos(nanos);
                let mut commanded = PerAxis::default();
                commanded[Axis::X] = radius_mm * angle.cos();
                commanded[Axis::Y] = radius_mm * (sign * angle).sin();
                commanded[Axis::Z] = 30.0;
                builder.take(Input::State(AxisState {
                    received_at: at,
                    controller_at: Stamp::from_nanos(nanos),
                    axes: AxisSet::XYZ,
                    commanded,
                    motor: commanded,
                    scale: PerAxis([f64::NAN; 6]),
                    velocity: PerAxis::default(),
                }));
                builder.take(Input::Grid(GridSample {
                    at,
                    plane: TestPlane::Xy,
                    u_mm: commanded[Axis::X],
                    v_mm: commanded[Axis::Y],
                    zero_id: 1,
                }));
                nanos += 10_000_000;
                angle += 0.25 / radius_mm;
            }
            builder.take(Input::Segment(segment(false)));
        }
    }
    builder.finish().expect("a session").0
}

pub fn floors(between_runs_um: f64) -> Floors {
    let floor = AssumedFloor {
        reading_um: 0.1,
        between_runs_um,
    };
    [(Instrument::Grid, floor)].into()
}

pub fn machine() -> MachineFile {
    MachineFile::parse(MACHINE, "machine.yaml").expect("a machine")
}
