//! 20,000 radial readings, 24 unknowns, by the function that the node calls, beside numpy.

use std::time::Instant;

use grid_encoder::basis::ModelComponent;
use grid_encoder::identify::{
    Disturbed, Identification, IdentifyOptions, Noise, PlateCertificate, default_basis, identify,
};
use grid_encoder::recording::{Fixture, GridPoint, Place, Recording};
use grid_encoder::unknown::Nuisances;
use machine::Kinematics;
use metrology::PerAxis;
use metrology::sample::TestPlane;
use nalgebra::Vector3;
use serde::Deserialize;

use crate::python;

const PASSES: usize = 9;
const STATIONS: u32 = 4_000;
const UNKNOWNS: usize = 24;
/// Of the greatest coefficient in mm at the edge: readings of 200 mm are rounded to 3e-14 mm.
const AGREEMENT: f64 = 1e-8;

#[derive(Deserialize)]
struct PeerFigures {
    whole_ms: f64,
    solve_ms: f64,
    rank: usize,
    beta: Vec<f64>,
    uncertainty: Vec<f64>,
}

fn recordings() -> Vec<Recording> {
    let centres = [
        (0.0, 0.0),
        (150.0, 0.0),
        (-150.0, 0.0),
        (0.0, 150.0),
        (0.0, -150.0),
    ];
    let recording = |(circle, (x, y)): (u32, (f64, f64))| {
        let mut place = Place::circle(TestPlane::Xy, Vector3::new(x, y, 0.0), 50.0, STATIONS);
        place.fixture = Fixture {
            zero_id: circle,
            setup_id: 0,
        };
        let point = |k: u32| {
            let angle_rad = f64::from(k) * std::f64::consts::TAU / f64::from(STATIONS);
            let positions = place.on_circle_mm(angle_rad);
            let i = f64::from(circle * STATIONS + k);
            let [du, dv] = [1e-3 * (0.7 * i + 0.3).sin(), 1e-3 * (1.3 * i).cos()];
            GridPoint {
                positions,
                sense: Vector3::zeros(),
                velocity_mm_s: Vector3::zeros(),
                reading_mm: [positions.0[0] + du, positions.0[1] + dv],
                standard_uncertainty_mm: [1e-4; 2],
                n_readings: 1,
            }
        };
        Recording {
            run: circle,
            place,
            points: (0..STATIONS).map(point).collect(),
        }
    };
    (0..).zip(centres).map(recording).collect()
}

fn options() -> IdentifyOptions {
    let component = |name: &str| {
        let component = name.parse().unwrap();
        ModelComponent {
            component,
            basis: default_basis(component, 0.0, 3),
        }
    };
    IdentifyOptions {
        components: ["EXX", "EYY", "EXY", "EYX", "EC0Y", "ECX"]
            .map(component)
            .to_vec(),
        nuisances: Nuisances {
            zero_offset: true,
            ..Nuisances::NONE
        },
        radial_only: true,
        rank_tolerance: 1e-9,
        outlier_limit: f64::INFINITY,
        recording_noise: false,
        noise: Noise::FromResiduals,
        disturbed: Disturbed::Found { start: None },
        certificate: PlateCertificate::EXACT,
    }
}

fn check(found: &Identification, peer: &PeerFigures) {
    assert_eq!(found.rank, peer.rank);
    let size = peer.beta.iter().fold(0.0_f64, |size, b| size.max(b.abs()));
    for (j, (beta, u)) in peer.beta.iter().zip(&peer.uncertainty).enumerate() {
        let ours = found.values[j] / found.scale[j];
        assert!(
            (ours - beta).abs() < AGREEMENT * size,
            "{j}: {ours}, numpy {beta}"
        );
        // numpy takes the residuals as independent.
        let our_u = (found.covariance[(j, j)] / found.variance_inflation).sqrt() / found.scale[j];
        assert!(
            (our_u / u - 1.0).abs() < AGREEMENT,
            "{j}: {our_u}, numpy {u}"
        );
    }
}

/// Prints ours, numpy's and the ratio, having checked that both find the same.
pub fn run() {
    let kinematics = Kinematics::of_chain("[w X' Y' b Z t]".parse().unwrap(), PerAxis::default());
    let (recordings, options) = (recordings(), options());
    let mut times = [0.0; PASSES];
    let mut found = None;
    for time in &mut times {
        let begin = Instant::now();
        found = Some(identify(&kinematics, &recordings, &options).unwrap());
        *time = begin.elapsed().as_secs_f64() * 1e3;
    }
    times.sort_by(f64::total_cmp);
    let (ours_ms, found) = (times[PASSES / 2], found.unwrap());
    assert_eq!(
        (found.n_equations, found.unknowns.len()),
        (20_000, UNKNOWNS)
    );
    println!("20,000 radial readings, {UNKNOWNS} unknowns, median of {PASSES} passes [ms]");
    println!(
        "ours     {ours_ms:>9.1}   rows, fit, residuals, covariance, what is estimable, judgement"
    );
    let Some(mut command) = python::peer("bench_lstsq.py") else {
        return;
    };
    let output = command
        .args([STATIONS.to_string(), PASSES.to_string()])
        .output()
        .unwrap();
    assert!(output.status.success(), "bench_lstsq.py: {}", output.status);
    let peer: PeerFigures = serde_json::from_slice(&output.stdout).unwrap();
    check(&found, &peer);
    let ratio = peer.whole_ms / ours_ms;
    println!(
        "numpy    {:>9.1}   rows, lstsq, residuals, variances; lstsq and after {:.1}; ratio {ratio:.2}",
        peer.whole_ms, peer.solve_ms
    );
}
