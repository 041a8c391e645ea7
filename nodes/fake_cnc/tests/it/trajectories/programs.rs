//! The programs: what two interpreters make of them, and which are refused.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::process::Command;

use fake_cnc::rs274::program::{Action, Aim, Plane, Program};
use fake_cnc::rs274::{Envelope, Registers, read, read_in};
use machine::file::AxisEntry;
use machine::trajectory::{TrajectoryError, diagonal, planar, positioning, scan};
use metrology::PerAxis;
use metrology::sample::TestPlane;

use super::*;

const PLACEMENTS: [&str; 3] = ["table", "upright_x", "upright_y"];

fn shapes() -> Vec<Shape> {
    let mut shapes = vec![
        Shape::Circle {
            radius_mm: 50.0,
            from_rad: 0.3,
        },
        Shape::Arc {
            radius_mm: 40.0,
            from_rad: FRAC_PI_4,
            swept_rad: 3.0 * FRAC_PI_2,
        },
        Shape::Spike {
            angle_rad: 0.5,
            length_mm: 40.0,
        },
        Shape::ArcWithLine {
            angle_rad: 0.2,
            line_mm: 30.0,
            radius_mm: 20.0,
            swept_rad: 2.0,
        },
        Shape::TwoArcs {
            angle_rad: -0.4,
            radii_mm: [20.0, 25.0],
            swept_rad: 1.8,
        },
    ];
    for angle_rad in [0.0, FRAC_PI_4, FRAC_PI_2] {
        shapes.push(Shape::Line {
            angle_rad,
            length_mm: 120.0,
        });
    }
    for between_rad in [FRAC_PI_2, 3.0 * FRAC_PI_4] {
        shapes.push(Shape::Corner {
            angle_rad: 0.1,
            between_rad,
            leg_mm: 40.0,
        });
    }
    shapes
}

/// Every shape in every plane, both senses, both ways of recording; then the spatial ones.
fn every_trajectory() -> Vec<Trajectory> {
    let machine = machine();
    let mut all = Vec::new();
    for placement in PLACEMENTS {
        for shape in shapes() {
            for pace in [STOPS, Pace::OnTheFly] {
                for sense in [Sense::CounterClockwise, Sense::Clockwise] {
                    let order = PlanarOrder {
                        sense,
                        ..order(placement, shape, pace)
                    };
                    all.push(planar(&machine, &order).unwrap());
                }
            }
        }
    }
    for beam in [None, Some("along_x")] {
        all.push(positioning(&machine, &run(beam)).unwrap());
        all.push(scan(&machine, &run(beam)).unwrap());
    }
    all.push(diagonal(&machine, &corner_to_corner()).unwrap());
    all
}

fn envelope(machine: &MachineFile) -> Envelope {
    Envelope {
        axes: machine.axis_set(),
        travel: PerAxis::from_fn(|axis| match machine.axes.get(&axis) {
            Some(AxisEntry::Linear(entry)) => entry.travel_mm,
            Some(AxisEntry::Rotary(entry)) => entry.travel_deg.map(f64::to_radians),
            None => [0.0; 2],
        }),
        speed: PerAxis::from_fn(|_| f64::INFINITY),
        spindle_limit_rpm: None,
        tool_lengths_mm: Vec::new(),
    }
}

fn read_program(text: &str) -> Program {
    let start = PerAxis([0.0, 0.0, 200.0, 0.0, 0.0, 0.0]);
    read(text, &envelope(&machine()), &start).unwrap()
}

/// Where the program dwells for a station's time.
fn dwells(program: &Program, dwell_s: f64) -> Vec<Vector3<f64>> {
    let mut at = Vector3::zeros();
    let mut stops = Vec::new();
    for step in &program.steps {
        match step.action {
            Action::Move(motion) => {
                for axis in Axis::LINEAR {
                    if let Aim::At(position_mm) = motion.aim[axis] {
                        at[axis.index()] = position_mm;
                    }
                }
            }
            Action::Dwell(time_s) if (time_s - dwell_s).abs() < 1e-9 => stops.push(at),
            _ => {}
        }
    }
    stops
}

/// A state that jobs leave: another system in use, offsets, a rotation, a tool, inches, a distance mode.
fn used() -> Registers {
    let mut used = Registers::default();
    used.systems[0].origin = PerAxis::from_fn(|axis| 3.0 + axis.index() as f64);
    used.systems[1].rotation_deg = 30.0;
    used.system = 1;
    used.tool[Axis::Z] = 50.0;
    used.stored_shift[Axis::X] = 2.0;
    used.modes.is_inch = true;
    used.modes.is_incremental = true;
    used.modes.plane = Plane::Yz;
    used.modes.has_absolute_centres = true;
    used
}

#[test]
fn in_machine_coordinates_every_trajectory_is_the_same_in_any_state() {
    let start = PerAxis([0.0, 0.0, 200.0, 0.0, 0.0, 0.0]);
    let doing = |program: &Program| -> Vec<Action> {
        let actions = program.steps.iter().map(|step| step.action);
        actions
            .filter(|action| !matches!(action, Action::Set(_)))
            .collect()
    };
    for trajectory in every_trajectory() {
        let mut text = trajectory.program.clone();
        if !text.starts_with("(frame: machine)") {
            text.insert_str(0, "(frame: machine)\n");
        }
        let of = |found: &Registers| read_in(&text, &envelope(&machine()), &start, found).unwrap();
        let (clean, in_use) = (of(&Registers::default()), of(&used()));
        assert_eq!(doing(&clean), doing(&in_use));
        assert_eq!(in_use.restored.as_deref(), Some(&used()));
        assert!(in_use.first_motion.is_some());
    }
}

#[test]
fn every_trajectory_is_taken_by_the_control_and_stops_at_its_stations() {
    for trajectory in every_trajectory() {
        let program = read_program(&trajectory.program);
        if let Some(setup) = &trajectory.setup {
            let steps = read_program(setup).steps;
            assert!(
                steps
                    .iter()
                    .any(|step| matches!(step.action, Action::Mount(0)))
            );
        }
        let stops = dwells(&program, 0.25);
        assert_eq!(stops.len(), trajectory.stations as usize);
        for (stop, wanted) in stops.iter().zip(&trajectory.stops_mm) {
            assert!((stop - wanted).norm() < 1e-5, "{stop} {wanted}");
        }
    }
}

#[test]
fn stations_of_a_circle_lie_on_it_in_the_right_plane_and_sense() {
    let machine = machine();
    for (placement, plane, [u, v, n]) in [
        ("table", TestPlane::Xy, [0, 1, 2]),
        ("upright_x", TestPlane::Yz, [1, 2, 0]),
        ("upright_y", TestPlane::Zx, [2, 0, 1]),
    ] {
        for (sense, sign) in [(Sense::CounterClockwise, 1.0), (Sense::Clockwise, -1.0)] {
            let shape = Shape::Circle {
                radius_mm: 50.0,
                from_rad: 0.0,
            };
            let order = PlanarOrder {
                sense,
                ..order(placement, shape, STOPS)
            };
            let circle = planar(&machine, &order).unwrap();
            assert_eq!((circle.plane, circle.sense), (plane, sense));
            for (k, stop) in circle.stops_mm.iter().enumerate() {
                let from_centre = stop - circle.centre_mm;
                let angle = sign * (k as f64 * 10.0).to_radians();
                assert!((from_centre[u] - 50.0 * angle.cos()).abs() < 1e-9);
                assert!((from_centre[v] - 50.0 * angle.sin()).abs() < 1e-9);
                assert!(from_centre[n].abs() < 1e-12);
            }
        }
    }
}

/// Positions at which LinuxCNC's interpreter dwells, from its canonical calls.
fn linuxcnc_dwells(text: &str, dwell_s: f64) -> Option<Vec<Vector3<f64>>> {
    if !std::path::Path::new("/usr/bin/rs274").exists() {
        let on_ci = std::env::var("CI").is_ok_and(|value| value == "true");
        assert!(!on_ci, "rs274 is not installed (package linuxcnc-uspace)");
        eprintln!("NOT TESTED: rs274 is not installed (package linuxcnc-uspace)");
        return None;
    }
    let folder = std::env::temp_dir().join(format!("abbe-trajectories-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("program.ngc");
    std::fs::write(&path, text).unwrap();
    let run = Command::new("/usr/bin/rs274").arg("-g").arg(&path).output();
    let said = String::from_utf8(run.unwrap().stdout).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(said.contains("PROGRAM_END"), "{said}");
    let (mut at, mut plane, mut stops) = (Vector3::zeros(), [0, 1, 2], Vec::new());
    for line in said.lines() {
        let Some((call, rest)) = line.split_once("N..... ").and_then(|l| l.1.split_once('('))
        else {
            continue;
        };
        let numbers: Vec<f64> = rest
            .trim_end_matches(')')
            .split([',', ' '])
            .filter_map(|word| word.parse().ok())
            .collect();
        match call {
            "SELECT_PLANE" if rest.contains("XY") => plane = [0, 1, 2],
            "SELECT_PLANE" if rest.contains("YZ") => plane = [1, 2, 0],
            "SELECT_PLANE" => plane = [2, 0, 1],
            "STRAIGHT_TRAVERSE" | "STRAIGHT_FEED" => {
                at = Vector3::new(numbers[0], numbers[1], numbers[2]);
            }
            "ARC_FEED" => {
                at[plane[0]] = numbers[0];
                at[plane[1]] = numbers[1];
                at[plane[2]] = numbers[5];
            }
            "DWELL" if (numbers[0] - dwell_s).abs() < 1e-6 => stops.push(at),
            _ => {}
        }
    }
    Some(stops)
}

#[test]
fn val_linuxcnc_goes_where_the_programs_say() {
    let mut worst_mm = 0.0_f64;
    for trajectory in every_trajectory() {
        let Some(stops) = linuxcnc_dwells(&trajectory.program, 0.25) else {
            return;
        };
        assert_eq!(stops.len(), trajectory.stations as usize);
        for (stop, wanted) in stops.iter().zip(&trajectory.stops_mm) {
            worst_mm = worst_mm.max((stop - wanted).norm());
        }
    }
    eprintln!("greatest distance of a LinuxCNC stop from its station: {worst_mm:.2e} mm");
    assert!(worst_mm < 1e-4, "{worst_mm}");
}

#[test]
#[expect(
    clippy::too_many_lines,
    reason = "a table of cases, read from top to bottom"
)]
fn trajectories_that_cannot_be_run_are_refused_by_name() {
    let machine = machine();
    let circle = |radius_mm| Shape::Circle {
        radius_mm,
        from_rad: 0.0,
    };
    let told = |order: &PlanarOrder<'_>| planar(&machine, order).unwrap_err().to_string();
    assert_eq!(
        told(&order("wall", circle(50.0), STOPS)),
        "the machine file has no placement of a grid encoder \"wall\" (known: table, upright_x, upright_y)"
    );
    assert_eq!(
        told(&order("table", circle(105.0), STOPS)),
        "placement \"table\": the head would be 114.434 mm from the plate's centre, its field ends at 110 mm"
    );
    let fast = PlanarOrder {
        feed_mm_min: 6000.0,
        ..order("table", circle(5.0), Pace::OnTheFly)
    };
    assert_eq!(
        told(&fast),
        "radius of curvature 5 mm: feed 6000 mm/min needs at least 6.667 mm at an acceleration of 3000 mm/s2"
    );
    let too_fast = PlanarOrder {
        feed_mm_min: 30_000.0,
        ..fast
    };
    assert!(told(&too_fast).contains("exceeds the limit of axis X, 20000 mm/min"));
    let one = Pace::Stationwise {
        stations: 1,
        dwell_s: 1.0,
    };
    assert!(told(&order("table", circle(50.0), one)).starts_with("stations = 1: must be"));
    let refused = |order: &AxisRun<'_>| positioning(&machine, order).unwrap_err();
    let mut back = run(None);
    back.targets_mm = vec![0.0, 20.0, 10.0];
    assert_eq!(
        refused(&back).to_string(),
        "targets[2] = 10 mm: must be above targets[1] = 20 mm"
    );
    back.targets_mm = vec![0.0, f64::NAN];
    assert!(matches!(
        refused(&back),
        TrajectoryError::TargetsNotAscending { index: 1, .. }
    ));
    back.targets_mm = vec![-319.0, 0.0];
    assert!(
        refused(&back)
            .to_string()
            .starts_with("overrun: axis X would go to -334 mm")
    );
    for axis in [Axis::A, Axis::C] {
        let mut turning = run(None);
        turning.axis = axis;
        let wanted = format!("axis = {axis}: must be X, Y or Z: this trajectory runs along a line");
        assert_eq!(refused(&turning).to_string(), wanted);
        assert_eq!(scan(&machine, &turning).unwrap_err().to_string(), wanted);
    }
    let mut off_axis = run(Some("along_x"));
    off_axis.axis = Axis::Y;
    assert_eq!(
        refused(&off_axis).to_string(),
        "beam \"along_x\" does not run along axis Y alone"
    );
}

#[test]
fn uneven_targets_keep_their_ends_and_their_order_and_no_two_gaps_are_alike() {
    let targets = uneven_targets_mm(-300.0, 300.0, 20.0).unwrap();
    assert_eq!(targets.len(), 31);
    assert!((targets[0] + 300.0).abs() < 1e-12 && (targets[30] - 300.0).abs() < 1e-12);
    let gaps: Vec<f64> = targets.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(
        gaps.iter().all(|gap| (13.0..27.0).contains(gap)),
        "{gaps:?}"
    );
    // A screw of 10 mm lead is met at phases that cover its turn.
    let phases = targets.iter().map(|target| (target / 10.0).rem_euclid(1.0));
    let covered: std::collections::BTreeSet<_> = phases.map(|phase| (phase * 5.0) as u32).collect();
    assert_eq!(covered.len(), 5);
}
