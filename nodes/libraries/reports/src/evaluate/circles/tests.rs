use super::*;
use metrology::fit::fit_round;
use metrology::{AxisSet, PerAxis};
use nalgebra::{Vector2, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};

const RADIUS_MM: f64 = 50.0;
const FEED_MM_S: f64 = 50.0;

fn segment(begin: bool, run: u32, sense: Sense) -> TestSegment {
    TestSegment {
        begin,
        plane: TestPlane::Yz,
        centre_mm: Vector3::new(1.0, 20.0, 30.0),
        radius_mm: RADIUS_MM,
        feed_mm_s: FEED_MM_S,
        sense,
        zero_id: 7,
        setup_id: 1,
        completed: !begin,
        ..TestSegment::of_kind(TestKind::Circle, run, Stamp::from_nanos(0))
    }
}

fn state(time_s: f64, u_mm: f64, v_mm: f64) -> AxisState {
    let mut commanded = PerAxis::default();
    commanded[Axis::X] = 1.0;
    commanded[Axis::Y] = 20.0 + u_mm;
    commanded[Axis::Z] = 30.0 + v_mm;
    let nanos = (time_s * 1e9).round() as i64;
    AxisState::standing(
        Stamp::from_nanos(nanos),
        Stamp::from_nanos(nanos + 5_000_000_000),
        AxisSet::XYZ,
        commanded,
    )
}

/// A circle at 50 mm/s in ticks of 10 ms, run in along a radius; the plate lies 3 mm off. Without a number of its zero
/// it is read by a ballbar.
fn recorded(zero_id: impl Into<Option<u32>>) -> Vec<CircleRecording> {
    let zero_id = zero_id.into();
    let mut circles = Circles::default();
    circles.segment(&segment(true, 3, Sense::CounterClockwise));
    let place = |tick: u32| {
        if tick < 40 {
            (f64::from(tick) * 1.25, 0.0)
        } else {
            let angle = f64::from(tick - 40) * 0.01;
            (RADIUS_MM * angle.cos(), RADIUS_MM * angle.sin())
        }
    };
    for tick in 0..(40 + 629) {
        let (u, v) = place(tick);
        let state = state(f64::from(tick) * 0.01, u, v);
        circles.axes(&state);
        // An oval of 2 µm, on a plate that was zeroed 3 mm beside the centre.
        let stretch = 1.0 + 4e-5;
        match zero_id {
            Some(zero_id) => circles.grid(&GridSample {
                at: state.received_at,
                plane: TestPlane::Yz,
                u_mm: u * stretch + 3.0,
                v_mm: v - 1.0,
                zero_id,
            }),
            None => circles.length(&LengthSample {
                at: state.received_at,
                axis: Axis::Y,
                displacement_mm: (u * stretch).hypot(v),
                zero_id: 1,
            }),
        }
    }
    circles.segment(&segment(false, 3, Sense::CounterClockwise));
    circles.recordings()
}

/// Greatest and least distance from the nominal radius, mm.
fn extremes_mm(circle: &CircleRecording) -> [f64; 2] {
    let radial = circle.points.iter().map(|p| {
        let [u, v] = p.at_mm;
        u.hypot(v) - RADIUS_MM
    });
    radial.fold([f64::MIN, f64::MAX], |[most, least], r| {
        [most.max(r), least.min(r)]
    })
}

#[test]
fn readings_on_the_circle_at_feed_are_kept_about_the_nominal_centre() {
    for (recordings, instrument) in [
        (recorded(7), Instrument::GridEncoder),
        (recorded(None), Instrument::Ballbar),
    ] {
        assert_eq!(recordings.len(), 1);
        assert_eq!(recordings[0].instrument, instrument);
        let points = &recordings[0].points;
        assert!((620..=630).contains(&points.len()), "{}", points.len());
        let [greatest, least] = extremes_mm(&recordings[0]);
        assert!((greatest - 0.002).abs() < 2e-5, "{greatest}");
        assert!(least.abs() < 2e-5, "{least}");
        assert!(!recordings[0].compensated);
        // Just one turn long: nothing can be left out, and that is said.
        assert_eq!(recordings[0].turn.by, TurnBy::TooShort);
        assert_eq!(recordings[0].turn.n_left_out, 0);
    }
}

#[test]
fn readings_under_another_zero_are_not_of_this_circle() {
    assert!(recorded(8)[0].points.is_empty());
}

/// How a circle is recorded: angle from the start of the motion on the circle to the turn and behind it, and the rates.
struct Recording {
    run_in_rad: f64,
    run_out_rad: f64,
    /// Time between states outside of the turn and within it, s.
    rates_s: [f64; 2],
    /// Where the path lies on the plate, mm.
    off_mm: [f64; 2],
    sense: Sense,
    run: u32,
    /// How long the states come closer, as an angle.
    marked_rad: f64,
}

impl Recording {
    /// Drives it: the loops settle from 5 µm inside the circle with a time constant of 50 ms.
    fn drive(&self, circles: &mut Circles, begin_s: f64) {
        let sign = if self.sense == Sense::Clockwise {
            -1.0
        } else {
            1.0
        };
        circles.segment(&segment(true, self.run, self.sense));
        let end_rad = self.run_in_rad + TAU + self.run_out_rad;
        let mut time_s = 0.0;
        loop {
            let swept_rad = time_s * FEED_MM_S / RADIUS_MM;
            if swept_rad > end_rad {
                break;
            }
            let turn_rad = swept_rad - self.run_in_rad;
            let (sin, cos) = (sign * turn_rad).sin_cos();
            let state = state(begin_s + time_s, RADIUS_MM * cos, RADIUS_MM * sin);
            circles.axes(&state);
            let radius_mm = RADIUS_MM - 0.005 * (-time_s / 0.05).exp();
            circles.grid(&GridSample {
                at: state.received_at,
                plane: TestPlane::Yz,
                u_mm: radius_mm * cos + self.off_mm[0],
                v_mm: radius_mm * sin + self.off_mm[1],
                zero_id: 7,
            });
            let is_turn = (-1e-9..self.marked_rad).contains(&turn_rad);
            time_s += self.rates_s[usize::from(is_turn)];
        }
        circles.segment(&segment(false, self.run, self.sense));
    }
}

fn alone(recording: &Recording) -> CircleRecording {
    let mut circles = Circles::default();
    recording.drive(&mut circles, 0.0);
    circles.recordings().remove(0)
}

const MARKED: Recording = Recording {
    run_in_rad: 0.6,
    run_out_rad: 0.4,
    rates_s: [0.02, 0.001],
    off_mm: [3.0, -1.0],
    sense: Sense::CounterClockwise,
    run: 1,
    marked_rad: TAU,
};

#[test]
fn the_full_rate_marks_the_turn_and_the_run_in_before_it_is_left_out() {
    let circle = alone(&MARKED);
    assert_eq!(circle.turn.by, TurnBy::FullRate);
    // 0.6 rad at 1 rad/s; the first state at feed comes a step of 20 ms after the motion began.
    assert!(
        (circle.turn.left_out_rad - 0.58).abs() < 0.021,
        "{:?}",
        circle.turn
    );
    assert!((circle.turn.left_out_s - circle.turn.left_out_rad).abs() < 1e-6);
    // 0.58 s and 0.4 s in steps of 20 ms.
    assert!(
        (46..=51).contains(&circle.turn.n_left_out),
        "{:?}",
        circle.turn
    );
    assert!((6280..=6300).contains(&circle.points.len()));
    // 5 µm e^(-12) = 3e-5 µm is left of the settling; the readings at feed before the turn begin 3.4 µm inside.
    let [greatest, least] = extremes_mm(&circle);
    assert!(greatest - least < 1e-6, "{greatest} {least}");
}

/// Angle from the first point to the last one, rad.
fn spanned_rad(circle: &CircleRecording) -> f64 {
    let pairs = circle.points.windows(2).map(|pair| {
        let ([u, v], [u1, v1]) = (pair[0].at_mm, pair[1].at_mm);
        (u * v1 - v * u1).atan2(u * u1 + v * v1)
    });
    pairs.sum::<f64>().abs()
}

#[test]
fn a_marked_turn_that_is_longer_than_360_degrees_is_trimmed_to_one_turn() {
    // 365.5 degrees, as a control that switches its rate late marks them.
    let circle = alone(&Recording {
        marked_rad: 365.5_f64.to_radians(),
        ..MARKED
    });
    assert_eq!(circle.turn.by, TurnBy::FullRate);
    let spanned_rad = spanned_rad(&circle);
    // Points 1 mrad apart; the first one is that of the last sparse state, 20 mrad before.
    assert!((TAU - 0.021..TAU).contains(&spanned_rad), "{spanned_rad}");
    // It begins where the mark does.
    assert!((circle.turn.left_out_rad - 0.58).abs() < 0.021);
}

#[test]
fn without_a_marked_turn_one_turn_is_evaluated_half_a_second_after_the_feed_is_reached() {
    let circle = alone(&Recording {
        run_in_rad: 1.0,
        rates_s: [0.005; 2],
        ..MARKED
    });
    assert_eq!(circle.turn.by, TurnBy::Settling);
    assert!((circle.turn.left_out_s - SETTLING_S).abs() < 0.006);
    let [greatest, least] = extremes_mm(&circle);
    // 5 µm e^(-10).
    assert!(greatest - least < 1e-6, "{greatest} {least}");
    // One turn in steps of 5 ms, no more.
    assert!((1256..=1258).contains(&circle.points.len()));
}

#[test]
fn a_recording_without_room_for_the_settling_is_evaluated_at_its_last_turn_and_says_so() {
    let circle = alone(&Recording {
        run_in_rad: 0.1,
        run_out_rad: 0.1,
        rates_s: [0.005; 2],
        ..MARKED
    });
    assert_eq!(circle.turn.by, TurnBy::TooShort);
    assert!((circle.turn.left_out_s - 0.195).abs() < 0.006);
}

#[test]
fn lost_states_do_not_mark_a_turn() {
    let mut lossy = Circles::default();
    lossy.segment(&segment(true, 1, Sense::CounterClockwise));
    for k in (0..1600).filter(|k| k % 400 != 40) {
        let time_s = f64::from(k) * 0.005;
        let state = state(time_s, RADIUS_MM * time_s.cos(), RADIUS_MM * time_s.sin());
        lossy.axes(&state);
        lossy.grid(&GridSample {
            at: state.received_at,
            plane: TestPlane::Yz,
            u_mm: RADIUS_MM * time_s.cos(),
            v_mm: RADIUS_MM * time_s.sin(),
            zero_id: 7,
        });
    }
    lossy.segment(&segment(false, 1, Sense::CounterClockwise));
    assert_eq!(lossy.recordings()[0].turn.by, TurnBy::Settling);
}

/// Least-squares centre.
fn centre_mm(circle: &CircleRecording) -> [f64; 2] {
    let points: Vec<Vector2<f64>> = circle.points.iter().map(|p| p.at_mm.into()).collect();
    let found = fit_round(&points, &vec![1.0; points.len()]);
    found.unwrap().centre_mm.into()
}

#[test]
fn what_two_senses_differ_by_stays_where_they_have_one_zero() {
    // 1 µm along u from one sense to the other. Each shifted alone, both would lie at the nominal centre; together they
    // lie half of it to either side.
    let mut circles = Circles::default();
    let (run_in_rad, run_out_rad) = (FRAC_PI_2, 0.4);
    let ccw = Recording {
        run_in_rad,
        run_out_rad,
        ..MARKED
    };
    ccw.drive(&mut circles, 0.0);
    let cw = Recording {
        off_mm: [3.001, -1.0],
        sense: Sense::Clockwise,
        run: 2,
        ..ccw
    };
    cw.drive(&mut circles, 60.0);
    let found = circles.recordings();
    let [ccw, cw] = [centre_mm(&found[0]), centre_mm(&found[1])];
    assert!((cw[0] - ccw[0] - 0.001).abs() < 1e-7, "{ccw:?} {cw:?}");
    assert!((cw[0] + ccw[0]).abs() < 1e-6, "{ccw:?} {cw:?}");
    assert!((cw[1] - ccw[1]).abs() < 1e-7, "{ccw:?} {cw:?}");
}
