//! Touches of the first-run machine's artefacts.

use fake_cnc::plant::{BumpEntry, ProbeFaultEntry, TrueContact};
use fake_cnc::{Plant, ProbeEdge};
use machine::file::ArtefactEntry;
use metrology::stamp::Span;
use metrology::{Axis, PerAxis};

use crate::plant::rig::{Command, PERIOD, PERIOD_S, Servo, machine, perfect, truth};

/// What a touch showed.
pub struct Touch {
    pub edges: Vec<(Span, ProbeEdge)>,
    contacts: Vec<TrueContact>,
    /// True position of the ball's centre at the closing contact, mm.
    ball_at_contact: Option<nalgebra::Vector3<f64>>,
}

/// Moves from `from` by `way_mm` along `axis` at `feed_mm_s` (sign with it), and back when `returns`.
pub fn touch(
    plant: &mut Plant,
    from: &PerAxis<f64>,
    axis: Axis,
    way_mm: f64,
    feed_mm_s: f64,
    returns: bool,
) -> Touch {
    plant.settle_at(from);
    let mut servo = Servo::default();
    let mut command = Command {
        position: *from,
        ..Command::default()
    };
    let mut seen = Touch {
        edges: Vec::new(),
        contacts: Vec::new(),
        ball_at_contact: None,
    };
    let mut ball = plant.tool_in_workpiece_mm();
    let mut known = plant.true_contact();
    let out_s = way_mm.abs() / feed_mm_s;
    let whole_s = if returns { 2.0 * out_s + 0.02 } else { out_s };
    let mut t = 0.0;
    while t < whole_s {
        let sign = if t < out_s { 1.0 } else { -1.0 } * way_mm.signum();
        command.velocity[axis] = sign * feed_mm_s;
        command.position[axis] += command.velocity[axis] * PERIOD_S;
        let start = plant.elapsed();
        let demand = servo.demand(plant, &command);
        plant.step(&demand, 0.0, PERIOD);
        seen.edges.extend(plant.probe_edges().iter().map(|edge| {
            (
                Span::from_nanos(start.nanos() + edge.after_period_start.nanos()),
                *edge,
            )
        }));
        let ball_after = plant.tool_in_workpiece_mm();
        if plant.true_contact() != known {
            known = plant.true_contact();
            let contact = known.unwrap();
            let share = (contact.at.nanos() - start.nanos()) as f64 / 1e6;
            if contact.closed && seen.ball_at_contact.is_none() {
                seen.ball_at_contact = Some(ball + (ball_after - ball) * share);
            }
            seen.contacts.push(contact);
        }
        ball = ball_after;
        t += PERIOD_S;
    }
    seen
}

/// Ball in front of the X face of the first block, whose corner is at (-220, -180, 20).
pub fn before_x_face() -> PerAxis<f64> {
    PerAxis([-224.0, -174.0, 14.0, 0.0, 0.0, 0.0])
}

#[test]
fn val_a_touch_recovers_the_face_within_the_pretravel() {
    let touches = [
        (before_x_face(), Axis::X, 1.1, -223.0),
        (
            PerAxis([-214.0, -184.0, 14.0, 0.0, 0.0, 0.0]),
            Axis::Y,
            1.1,
            -183.0,
        ),
        (
            PerAxis([-214.0, -174.0, 24.0, 0.0, 0.0, 0.0]),
            Axis::Z,
            -1.1,
            23.0,
        ),
    ];
    for (from, axis, way_mm, face_mm) in touches {
        let mut plant = Plant::new(&machine(), &perfect()).unwrap();
        let seen = touch(&mut plant, &from, axis, way_mm, 2.0, false);
        let ball = seen.ball_at_contact.unwrap()[axis.index()];
        let pretravel_mm = (ball - face_mm) * way_mm.signum();
        let expected = if axis == Axis::Z {
            0.0..2e-4
        } else {
            1.8e-3..4.2e-3
        };
        assert!(expected.contains(&pretravel_mm), "{axis}: {pretravel_mm}");
    }
}

#[test]
fn val_latency_and_jitter_lie_between_contact_and_arrival() {
    let truth = truth();
    let mut plant = Plant::new(&machine(), &truth).unwrap();
    let mut delays_s = Vec::new();
    for _ in 0..60 {
        let seen = touch(&mut plant, &before_x_face(), Axis::X, 1.1, 8.0, false);
        // Putting the ball back before the face opened the contact of the touch before.
        let closing: Vec<_> = seen.edges.iter().filter(|(_, edge)| edge.closed).collect();
        assert_eq!((closing.len(), seen.contacts.len()), (1, 1));
        let (arrival, _) = closing[0];
        assert!(plant.probe_closed());
        delays_s.push((arrival.nanos() - seen.contacts[0].at.nanos()) as f64 * 1e-9);
    }
    let n = delays_s.len() as f64;
    let mean_s = delays_s.iter().sum::<f64>() / n;
    let deviation_s =
        (delays_s.iter().map(|d| (d - mean_s).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    assert!((mean_s - 3.7e-3).abs() < 4.0 * 2e-5 / n.sqrt(), "{mean_s}");
    assert!((1.4e-5..2.7e-5).contains(&deviation_s), "{deviation_s}");
    assert!((plant.probe_latency_s() - 3.7e-3).abs() < 1e-15);
}

#[test]
fn the_latched_motor_is_where_the_motor_was_at_the_arrival() {
    let mut plant = Plant::new(&machine(), &truth()).unwrap();
    let seen = touch(&mut plant, &before_x_face(), Axis::X, 1.1, 8.0, false);
    let (arrival, edge) = seen.edges[0];
    let contact = seen.contacts[0].at;
    let ball = seen.ball_at_contact.unwrap().x;
    let passed_s = (arrival.nanos() - contact.nanos()) as f64 * 1e-9;
    let latched = edge.motor_at_arrival[Axis::X];
    // Motor and ball differ by play and cold errors, not by the 30 um of the latency.
    assert!(
        (latched - ball - 8.0 * passed_s).abs() < 0.012,
        "{latched} {ball}"
    );
}

#[test]
fn the_release_comes_with_hysteresis_and_its_own_latency() {
    let mut truth = perfect();
    truth.touch_probe.jitter_ms = 0.0;
    let mut plant = Plant::new(&machine(), &truth).unwrap();
    let seen = touch(&mut plant, &before_x_face(), Axis::X, 1.1, 4.0, true);
    let closed: Vec<_> = seen.edges.iter().map(|(_, edge)| edge.closed).collect();
    assert_eq!(closed, [true, false]);
    assert!(!plant.probe_closed());
    for ((arrival, _), contact) in seen.edges.iter().zip(&seen.contacts) {
        assert_eq!(arrival.nanos() - contact.at.nanos(), 3_700_000);
    }
}

#[test]
fn touches_scatter_with_the_stated_repeatability() {
    let mut truth = perfect();
    truth.touch_probe.repeatability_um = 0.3;
    let mut plant = Plant::new(&machine(), &truth).unwrap();
    let places: Vec<_> = (0..60)
        .map(|_| {
            let seen = touch(&mut plant, &before_x_face(), Axis::X, 1.1, 4.0, false);
            seen.ball_at_contact.unwrap().x
        })
        .collect();
    let n = places.len() as f64;
    let mean = places.iter().sum::<f64>() / n;
    let deviation = (places.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    assert!((2.1e-4..4.0e-4).contains(&deviation), "{deviation}");
}

#[test]
fn artefacts_turn_with_the_table() {
    let mut machine = machine();
    let (radius_mm, centre_mm) = (10.0, [100.0, 0.0, 60.0]);
    machine.artefacts.push(ArtefactEntry::Sphere {
        id: "ball".to_owned(),
        centre_mm,
        radius_mm,
    });
    // C = 90 degrees brings the sphere from +X to +Y; A tilts it about the line Z = 50.
    let turned = [
        ([0.0, 100.0, 74.0, 0.0, 0.0, 90.0], 60.0),
        ([100.0, 10.0, 64.0, -90.0, 0.0, 0.0], 50.0),
    ];
    for ([x, y, z, a, b, c], middle_mm) in turned {
        let mut plant = Plant::new(&machine, &perfect()).unwrap();
        let angle = |degrees: f64| degrees.to_radians();
        let from = PerAxis([x, y, z, angle(a), angle(b), angle(c)]);
        let seen = touch(&mut plant, &from, Axis::Z, -1.2, 2.0, false);
        let (_, edge) = seen.edges[0];
        let height_mm = edge.motor_at_arrival[Axis::Z] + 2.0 * 3.7e-3;
        assert!((height_mm - middle_mm - 13.0).abs() < 0.01, "{height_mm}");
    }
}

#[test]
fn a_bore_is_touched_from_inside() {
    let mut machine = machine();
    let (radius_mm, centre_mm) = (25.0, [0.0, 60.0, 40.0]);
    machine.artefacts.push(ArtefactEntry::Bore {
        id: "ring".to_owned(),
        centre_mm,
        radius_mm,
    });
    let mut plant = Plant::new(&machine, &perfect()).unwrap();
    let from = PerAxis([0.0, 81.0, 40.0, 0.0, 0.0, 0.0]);
    let seen = touch(&mut plant, &from, Axis::Y, 1.2, 2.0, false);
    let ball = seen.ball_at_contact.unwrap();
    assert!((1.5e-3..4.5e-3).contains(&(ball.y - 82.0)), "{ball}");
}

#[test]
fn a_dead_probe_says_nothing() {
    let mut truth = perfect();
    truth.faults.probe = ProbeFaultEntry::Dead { from_s: 0.0 };
    let mut plant = Plant::new(&machine(), &truth).unwrap();
    let seen = touch(&mut plant, &before_x_face(), Axis::X, 1.1, 4.0, false);
    assert!(seen.edges.is_empty() && !plant.probe_closed());
    assert_eq!(
        seen.contacts.len(),
        1,
        "the stylus was deflected all the same"
    );
}

#[test]
fn a_probe_sticks_closed_from_its_time_on() {
    let mut truth = perfect();
    truth.faults.probe = ProbeFaultEntry::StuckClosed { from_s: 0.1 };
    let mut plant = Plant::new(&machine(), &truth).unwrap();
    plant.settle_at(&before_x_face());
    let mut closed_at = None;
    for tick in 0..300 {
        plant.step(&PerAxis::default(), 0.0, PERIOD);
        if plant.probe_closed() && closed_at.is_none() {
            closed_at = Some(tick);
        }
    }
    assert_eq!(closed_at, Some(99));
}

#[test]
fn a_bouncing_contact_sends_pairs_of_edges_and_ends_closed() {
    let mut truth = perfect();
    truth.faults.probe = ProbeFaultEntry::Bounce {
        pairs: 3,
        spacing_us: 150.0,
    };
    let mut plant = Plant::new(&machine(), &truth).unwrap();
    let seen = touch(&mut plant, &before_x_face(), Axis::X, 1.1, 4.0, false);
    let closed: Vec<_> = seen.edges.iter().map(|(_, edge)| edge.closed).collect();
    assert_eq!(closed, [true, false, true, false, true, false, true]);
    assert!(seen.edges.windows(2).all(|pair| pair[0].0 < pair[1].0));
    assert!(plant.probe_closed());
}

#[test]
fn a_missing_block_is_not_touched() {
    let mut truth = perfect();
    truth.faults.missing_blocks.push("block_1".to_owned());
    let mut plant = Plant::new(&machine(), &truth).unwrap();
    let seen = touch(&mut plant, &before_x_face(), Axis::X, 1.1, 4.0, false);
    assert!(seen.edges.is_empty() && seen.contacts.is_empty());
}

#[test]
fn a_bumped_block_is_found_elsewhere_afterwards() {
    let mut truth = perfect();
    truth.faults.bumped_blocks.push(BumpEntry {
        id: "block_1".to_owned(),
        at_s: 5.0,
        shift_um: [40.0, 0.0, 0.0],
    });
    let mut plant = Plant::new(&machine(), &truth).unwrap();
    let before = touch(&mut plant, &before_x_face(), Axis::X, 1.1, 4.0, false);
    for _ in 0..6000 {
        plant.step(&PerAxis::default(), 0.0, PERIOD);
    }
    let after = touch(&mut plant, &before_x_face(), Axis::X, 1.1, 4.0, false);
    let moved = after.ball_at_contact.unwrap().x - before.ball_at_contact.unwrap().x;
    assert!((moved - 0.04).abs() < 2e-4, "{moved}");
}

#[test]
fn equal_seeds_give_equal_bits_and_other_seeds_others() {
    let run = |seed: u64| {
        let mut truth = truth();
        truth.seed = seed;
        let mut plant = Plant::new(&machine(), &truth).unwrap();
        let seen = touch(&mut plant, &before_x_face(), Axis::X, 1.1, 4.0, true);
        let edges: Vec<_> = seen
            .edges
            .iter()
            .map(|(at, edge)| (at.nanos(), edge.motor_at_arrival.0.map(f64::to_bits)))
            .collect();
        (edges, plant.sensor_reading("bed").unwrap().to_bits())
    };
    assert_eq!(run(11), run(11));
    assert_ne!(run(11), run(12));
}
