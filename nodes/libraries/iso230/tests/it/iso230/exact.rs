//! Against closed forms: shapes and curves whose figures can be written down.

use std::f64::consts::TAU;

use iso230::budget::{DeviceUncertainty, Expansion};
use iso230::circular::{self, CircularBudget, CircularTest, CircularTrace};
use iso230::conformance::{Decision, Policy, Specification, decide};
use iso230::diagonal::{self, DiagonalRuns, SpaceDiagonal};
use iso230::positioning::PositioningRuns;
use iso230::positioning::budget::PositioningBudget;
use iso230::{ExpandedLength, probing};
use nalgebra::{Vector2, Vector3};

use crate::iso230::{EXACT, EXACT_DEVICE, RIGID, evaluated, near};

const CERTAIN: CircularBudget = CircularBudget {
    displacement: EXACT_DEVICE,
    length: None,
    machine: RIGID,
    device_expansion: RIGID,
    environmental_drift_mm: 0.0,
    environmental_unrest_mm: None,
};

fn radial(deviation_mm: impl Fn(f64) -> f64) -> CircularTrace {
    let angles_rad: Vec<f64> = (0..720).map(|k| TAU * f64::from(k) / 720.0).collect();
    CircularTrace::Radial {
        deviations_mm: angles_rad.iter().map(|a| deviation_mm(*a)).collect(),
        angles_rad,
    }
}

fn circle(clockwise: CircularTrace, counter_clockwise: CircularTrace) -> CircularTest {
    CircularTest {
        nominal_radius_mm: 100.0,
        clockwise: Some(clockwise),
        counter_clockwise: Some(counter_clockwise),
    }
}

#[test]
fn eq1_to_eq7_of_a_test_by_hand() {
    // Deviations −2, −1, 0, 1, 2 µm about each mean: s = √2.5 µm.
    let about = |up: [f64; 3]| -> Vec<Vec<f64>> {
        let run = |j: i32| up.map(|mean| 1e-3 * (mean + f64::from(j))).to_vec();
        (-2..=2).map(run).collect()
    };
    let result = evaluated(&PositioningRuns {
        targets_mm: vec![0.0, 101.0, 207.0],
        up_mm: about([0.0, 5.0, 9.0]),
        down_mm: about([-3.0, 3.0, 8.0]),
        zero_mm: 0.0,
        periods_mm: vec![],
    });
    let s = 2.5_f64.sqrt();
    let um = |what, figure: ExpandedLength, expected_um: f64| {
        near(what, figure.value_mm, 1e-3 * expected_um, 1e-15);
    };
    um("B", result.reversal, 3.0);
    um("mean B", result.mean_reversal, 2.0);
    um("R up", result.up.repeatability, 4.0 * s);
    um("R", result.repeatability, 4.0 * s + 3.0);
    um("E up", result.up.systematic_error, 9.0);
    um("E down", result.down.systematic_error, 11.0);
    um("E", result.systematic_error, 12.0);
    um("M", result.mean_systematic_error, 10.0);
    um("A down", result.down.accuracy, 11.0 + 4.0 * s);
    um("A", result.accuracy, 12.0 + 4.0 * s);
    // Student's t for four degrees of freedom: 2.776.
    let interval = result.points[0].up.interval;
    near("t", interval.coverage_factor, 2.776, 5e-4);
    near(
        "half width",
        interval.upper_mm,
        2.776_445e-3 * s / 5.0_f64.sqrt(),
        1e-9,
    );
}

#[test]
fn eq1_an_ellipse_has_the_difference_of_its_axes() {
    let (a, b) = (100.006, 99.997);
    let ellipse: Vec<[f64; 2]> = (0..720)
        .map(|k| TAU * f64::from(k) / 720.0)
        .map(|t| [a * t.cos() + 0.02, b * t.sin() - 0.01])
        .collect();
    let test = CircularTest {
        nominal_radius_mm: 100.0,
        clockwise: None,
        counter_clockwise: Some(CircularTrace::PointsMm(ellipse)),
    };
    let result = circular::evaluate(&test, &CERTAIN).unwrap();
    assert!(result.clockwise.is_none() && result.both.is_none());
    let sense = result.counter_clockwise.unwrap();
    near("G", sense.circular_error.value_mm, a - b, 1e-9);
    near("centre u", sense.centre_mm[0], 0.02, 1e-9);
    near("centre v", sense.centre_mm[1], -0.01, 1e-9);
}

#[test]
fn eq2_eq4_eq5_two_circles_of_different_size_differ_by_their_radii() {
    let test = circle(radial(|_| 0.007), radial(|_| 0.003));
    let both = circular::evaluate(&test, &CERTAIN).unwrap().both.unwrap();
    near("G(b)", both.circular_error.value_mm, 0.004, 1e-9);
    near("D", both.mean_radial_deviation.value_mm, 0.005, 1e-9);
    near("H", both.hysteresis_1996.value_mm, 0.004, 1e-9);
}

#[test]
fn recordings_of_twenty_thousand_points_are_evaluated() {
    let path = |sense: f64| {
        let angles_rad: Vec<f64> = (0..20_000)
            .map(|k| sense * TAU * f64::from(k) / 2e4)
            .collect();
        let deviation = |a: &f64| 0.005 * (3.0 * a).cos() + sense * 0.001;
        CircularTrace::Radial {
            deviations_mm: angles_rad.iter().map(deviation).collect(),
            angles_rad,
        }
    };
    let result = circular::evaluate(&circle(path(-1.0), path(1.0)), &CERTAIN).unwrap();
    let both = result.both.unwrap();
    near("G(b)", both.circular_error.value_mm, 0.012, 1e-8);
    near("H", both.hysteresis_1996.value_mm, 0.002, 1e-8);
}

#[test]
fn eq3_f_of_both_senses_is_about_their_common_centre() {
    // Two circles of one radius, 12 µm apart along u: each is round about its own centre. About the common one, 6 µm
    // from either, a sense is 6 µm too large on one side and 6 µm too small on the other, less e²/(2 R) = 0.2 nm.
    let (e, r) = (0.006, 100.004);
    let path = |e: f64| {
        let at = |t: f64| [r * t.cos() + e, r * t.sin()];
        let points = (0..360).map(|k| at(f64::from(k).to_radians()));
        CircularTrace::PointsMm(points.collect())
    };
    let result = circular::evaluate(&circle(path(-e), path(e)), &CERTAIN).unwrap();
    for sense in [result.clockwise.unwrap(), result.counter_clockwise.unwrap()] {
        near("G", sense.circular_error.value_mm, 0.0, 1e-9);
        let [greatest, least] = [
            sense.greatest_radial_deviation,
            sense.least_radial_deviation,
        ]
        .map(|f| f.value_mm);
        near("F max", greatest, 0.004 + e, 1e-6);
        near("F min", least, 0.004 - e, 1e-6);
    }
    let both = result.both.unwrap();
    near("G(b)", both.circular_error.value_mm, 2.0 * e, 1e-6);
    near("H", both.hysteresis_1996.value_mm, 2.0 * e, 1e-6);
    // Where the instrument stood is in no figure: the same paths 20 µm aside.
    let aside = |e: f64| path(e + 0.02);
    let shifted = circular::evaluate(&circle(aside(-e), aside(e)), &CERTAIN).unwrap();
    let shifted = shifted.clockwise.unwrap().greatest_radial_deviation;
    near("F max aside", shifted.value_mm, 0.004 + e, 1e-6);
}

#[test]
fn eq5_reversal_steps_of_opposite_senses_show_as_hysteresis() {
    // Backlash b of the u axis: +b/2 sgn(sin t) cos t counter-clockwise, the mirror clockwise;
    // the two part by b |cos t|, most at t = 0 and at half a turn.
    let b = 0.006;
    let step = |t: f64| b / 2.0 * t.sin().signum() * t.cos();
    let test = circle(radial(|t| -step(t)), radial(step));
    let both = circular::evaluate(&test, &CERTAIN).unwrap().both.unwrap();
    near("H", both.hysteresis_1996.value_mm, b, 1e-6);
    near("its angle", both.hysteresis_angle_rad.sin(), 0.0, 0.01);
}

#[test]
fn eq6_to_eq10_of_a_circular_budget_by_hand() {
    let root3 = 3.0_f64.sqrt();
    // Over R = 100 mm: the machine α a_θ R/√3 = 1e-5 × √3 × 100/√3 = 1 µm, the device 8e-6 × 0.75 √3 × 100/√3 = 0.6 µm;
    // drift 0.8 √3/(2 √3) = 0.4 µm.
    let plate = CircularBudget {
        displacement: DeviceUncertainty {
            expanded_uncertainty_mm: 0.0006,
            expanded_uncertainty_per_length: 2e-6,
            ..EXACT_DEVICE
        },
        length: None,
        machine: Expansion {
            temperature_half_width_k: root3,
            expansion_per_k: 1e-5,
            ..RIGID
        },
        device_expansion: Expansion {
            temperature_half_width_k: 0.75 * root3,
            expansion_per_k: 8e-6,
            ..RIGID
        },
        environmental_drift_mm: 0.0008 * root3,
        environmental_unrest_mm: Some(0.0001 * root3),
    };
    let ballbar = CircularBudget {
        length: Some(DeviceUncertainty {
            expanded_uncertainty_mm: 0.0008,
            ..EXACT_DEVICE
        }),
        ..plate
    };
    // The plate over R: U₀² = 0.36, 2 U₀ U₁ R = 0.24, (U₁ R)² = 0.04 µm², each by its share and by k² = 4. The ballbar: 0.3 µm
    // of the reading and 0.8/2 = 0.4 µm of its length, together 0.5 µm.
    let by_plate = [
        (0.867 * 0.36 + 0.468 * 0.24 + 0.04) / 4.0,
        (0.037 * 0.36 + 0.270 * 0.24 + 0.04) / 4.0,
        (0.830 * 0.36 + 0.198 * 0.24) / 4.0,
    ];
    // A plate reads one place in both senses, of a ballbar these are two readings.
    for (budget, [radius2, mean2, apart2], place2) in
        [(plate, by_plate, 0.0), (ballbar, [0.25, 0.25, 0.09], 0.09)]
    {
        let test = circle(radial(|_| 0.0), radial(|_| 0.0));
        let result = circular::evaluate(&test, &budget).unwrap();
        let both = result.both.unwrap();
        let expanded = |figure: ExpandedLength| figure.expanded_uncertainty_mm;
        let g2 = 2.0 * (apart2 + 0.16);
        let near =
            |what: &str, found: f64, right2: f64| near(what, found, 2e-3 * right2.sqrt(), 1e-15);
        near("U(G)", expanded(both.circular_error), g2);
        // Of a mean, a drift of 0.4 µm leaves half.
        let (f2, d2) = (radius2 + 0.16 + 1.0 + 0.36, mean2 + 0.04 + 1.0 + 0.36);
        // 4 w² ln n/3 with w² = 0.03 µm².
        let h2 = 2.0 * (place2 + 0.16) + 0.04 * 720.0_f64.ln();
        near("U(H)", expanded(both.hysteresis_1996), h2);
        let f = result.clockwise.unwrap().greatest_radial_deviation;
        near("U(F)", expanded(f), f2);
        near("U(D)", expanded(both.mean_radial_deviation), d2);
    }
}

#[test]
fn val_iso230_6_squareness_by_exact_geometry() {
    // X and Y enclose 90° + φ: a command y also moves φ y along x, and y cos φ along y.
    let (size, phi) = (Vector3::new(600.0, 500.0, 400.0), 50e-6_f64);
    let length_mm = size.norm();
    let place = |p: Vector3<f64>| Vector3::new(p.x + p.y * phi.sin(), p.y * phi.cos(), p.z);
    let shares: Vec<f64> = [0.0, 0.19, 0.42, 0.61, 0.83, 1.0].to_vec();
    let runs = |diagonal: SpaceDiagonal| {
        let signs = match diagonal {
            SpaceDiagonal::Ppp => Vector3::new(1.0, 1.0, 1.0),
            SpaceDiagonal::Npp => Vector3::new(-1.0, 1.0, 1.0),
            SpaceDiagonal::Pnp => Vector3::new(1.0, -1.0, 1.0),
            SpaceDiagonal::Ppn => Vector3::new(1.0, 1.0, -1.0),
        };
        let along = size.component_mul(&signs);
        let start = (size - along) / 2.0;
        // A laser reads the distance from the start.
        let reading =
            |share: &f64| (place(start + along * *share) - place(start)).norm() - share * length_mm;
        let up: Vec<f64> = shares.iter().map(reading).collect();
        let backlash_mm = 0.001 * f64::from(diagonal as u8);
        let down: Vec<f64> = up.iter().map(|x| x - backlash_mm).collect();
        DiagonalRuns {
            diagonal,
            runs: PositioningRuns {
                targets_mm: shares.iter().map(|s| s * length_mm).collect(),
                up_mm: vec![up; 5],
                down_mm: vec![down; 5],
                zero_mm: 0.0,
                periods_mm: vec![],
            },
        }
    };
    // In any order.
    let given: Vec<_> = SpaceDiagonal::ALL.into_iter().rev().map(runs).collect();
    let result = diagonal::evaluate(&given, &EXACT).unwrap();
    let end_mm = phi * size.x * size.y / length_mm;
    // PPP and PPN lengthen by end_mm; NPP and PNP shorten by it. PPN has the greatest backlash.
    near(
        "E_d",
        result.systematic_error.value_mm,
        end_mm + 0.003,
        2e-6,
    );
    near("B_d", result.reversal.value_mm, 0.003, 1e-15);
    near(
        "spread",
        result.spread.value_mm,
        end_mm + end_mm + 0.002,
        2e-6,
    );
    near("lengths", result.lengths.value_mm, end_mm + end_mm, 2e-6);
    assert_eq!(result.diagonals[1].diagonal, SpaceDiagonal::Npp);
    let shortest = &result.diagonals[1].positioning.points[5];
    near("NPP", shortest.up.mean_mm, -end_mm, 5e-7);
}

#[test]
fn u_of_the_lengths_of_diagonals_has_what_is_new_on_each_by_hand() {
    let length_mm = 877.0;
    let runs = |diagonal: SpaceDiagonal| DiagonalRuns {
        diagonal,
        runs: PositioningRuns {
            targets_mm: vec![0.0, 310.0, length_mm],
            up_mm: vec![vec![0.0, 0.001, 0.002 * f64::from(diagonal as u8)]; 5],
            down_mm: vec![vec![0.0, 0.001, 0.002 * f64::from(diagonal as u8)]; 5],
            zero_mm: 0.0,
            periods_mm: vec![],
        },
    };
    let given: Vec<_> = SpaceDiagonal::ALL.into_iter().map(runs).collect();
    // One laser and one machine read all four, so temperatures cancel: by hand 2 (0.2² + 2 · 0.2 · 0.5 l/mm · 1e-3) of the
    // certificate, 2 (0.1²/(4 l) / √3)² of the beam, 2/5 (0.3/√3)² of drift.
    let budget = PositioningBudget {
        device: DeviceUncertainty {
            expanded_uncertainty_mm: 0.4e-3,
            expanded_uncertainty_per_length: 1e-6,
            coverage_factor: 2.0,
        },
        misalignment_mm: 0.1,
        machine: Expansion {
            temperature_half_width_k: 0.5,
            expansion_per_k: 11e-6,
            ..EXACT.machine
        },
        environmental_drift_mm: 0.6e-3,
        ..EXACT
    };
    let stated = diagonal::evaluate(&given, &budget).unwrap().lengths;
    near("lengths", stated.value_mm, 0.006, 1e-15);
    let certificate = 2.0 * (0.04 + 2.0 * 0.2 * 0.5e-3 * length_mm);
    let beam = 2.0 * (0.01e3 / (4.0 * length_mm)).powi(2) / 3.0;
    let by_hand_um = 2.0 * (certificate + beam + 0.4 * 0.03_f64).sqrt();
    near(
        "U",
        stated.expanded_uncertainty_mm,
        by_hand_um * 1e-3,
        1e-12,
    );
}

#[test]
fn eq1_eq3_eq5_of_probing_by_hand() {
    let touches = [3.0, 1.0, 2.0, 2.0, 2.0].map(|um| 1e-3 * um);
    let result = probing::single_point(&touches, 0.0006).unwrap();
    near("R", result.repeatability.value_mm, 0.002, 1e-15);
    near(
        "s",
        result.standard_deviation_mm,
        0.001 * 0.5_f64.sqrt(),
        1e-15,
    );
    let u_drift_mm = 0.0003 / 3.0_f64.sqrt();
    let expanded_mm = result.repeatability.expanded_uncertainty_mm;
    near(
        "U(R)",
        expanded_mm,
        2.0 * 2.0_f64.sqrt() * u_drift_mm,
        1e-15,
    );
    assert_eq!(result.unusual_number.map(|u| (u.n, u.usual)), Some((5, 10)));

    // Three lobes of 4 µm on a ring of 50 mm that is touched from within by a ball of 3 mm.
    let ring: Vec<Vector2<f64>> = (0..36)
        .map(|k| f64::from(k * 10).to_radians())
        .map(|t| (22.0 + 0.004 * (3.0 * t).cos()) * Vector2::new(t.cos(), t.sin()))
        .collect();
    let artefact = probing::Artefact {
        diameter_mm: 49.998,
        diameter_uncertainty: DeviceUncertainty {
            expanded_uncertainty_mm: 0.001,
            ..EXACT_DEVICE
        },
        form_mm: 0.001 * 6.0_f64.sqrt(),
        form_standard_uncertainty_mm: 0.0,
        expansion: RIGID,
        stylus_radius_mm: 3.0,
        side: probing::Side::Inside,
    };
    let result = probing::ring(&ring, &artefact, 0.0).unwrap();
    near("P", result.form_error.value_mm, 0.008, 1e-6);
    near(
        "U(P)",
        result.form_error.expanded_uncertainty_mm,
        0.002,
        1e-15,
    );
    near("S", result.size_error.value_mm, 0.002, 1e-6);
    near(
        "U(S)",
        result.size_error.expanded_uncertainty_mm,
        0.001,
        1e-15,
    );
    assert_eq!(result.unusual_number, None);
}

#[test]
fn eq4_of_probing_is_a_range_per_coordinate() {
    let centres = [[1.0, 2.0, 3.0], [1.002, 1.999, 3.0], [0.999, 2.0, 3.0]].map(Vector3::from);
    let result = probing::location(&centres, 0.0).unwrap();
    let found: Vec<f64> = result.repeatability.iter().map(|r| r.value_mm).collect();
    near("x", found[0], 0.003, 1e-12);
    near("y", found[1], 0.001, 1e-12);
    near("z", found[2], 0.0, 0.0);
}

#[test]
fn eq1_eq3_of_conformance_at_the_ends_of_their_zones() {
    let zone = Specification {
        lower_mm: Some(0.0),
        upper_mm: Some(0.010),
    };
    let says = |value_mm: f64, policy| {
        let figure = ExpandedLength {
            value_mm,
            expanded_uncertainty_mm: 0.002,
        };
        decide(&figure, &zone, policy).unwrap().decision
    };
    let probability = Policy::Probability { at_least: 0.95 };
    for (value_um, simple, guarded, probable) in [
        (8.0, 'c', 'c', 'c'),
        (8.1, 'c', '?', 'c'),
        // 1.645 u = 1.645 µm from the limit.
        (8.35, 'c', '?', 'c'),
        (8.36, 'c', '?', '?'),
        (10.0, 'c', '?', '?'),
        (10.1, 'n', '?', '?'),
        (11.64, 'n', '?', '?'),
        (11.65, 'n', '?', 'n'),
        (11.99, 'n', '?', 'n'),
        (12.1, 'n', 'n', 'n'),
        (-1.9, 'n', '?', 'n'),
        (-2.1, 'n', 'n', 'n'),
    ] {
        let letter = |policy| match says(1e-3 * value_um, policy) {
            Decision::Conforms => 'c',
            Decision::DoesNotConform => 'n',
            Decision::CannotBeDecided => '?',
        };
        let found = (
            letter(Policy::Simple),
            letter(Policy::GuardBand),
            letter(probability),
        );
        assert_eq!(found, (simple, guarded, probable), "{value_um} um");
    }
}

#[test]
fn eq2_a_zone_as_wide_as_the_uncertainty_never_conforms() {
    // Zone ±u: at its middle P = 0.683, although the figure is 1 u from either limit.
    let figure = ExpandedLength::new(0.0, 0.001);
    let zone = Specification {
        lower_mm: Some(-0.001),
        upper_mm: Some(0.001),
    };
    let verdict = decide(&figure, &zone, Policy::Probability { at_least: 0.95 }).unwrap();
    near("P", verdict.probability_of_conformance, 0.6827, 5e-5);
    assert_eq!(verdict.decision, Decision::CannotBeDecided);
    near("guard band", verdict.guard_band_mm, 0.001_644_9, 1e-7);
}
