//! Whether intervals hold the truth where the plate as a whole is too long and not square, by what its certificate allows.

use grid_encoder::identify::{
    Disturbed, Identification, IdentifyOptions, PlateCertificate, identify,
};
use grid_encoder::recording::Recording;
use machine::{Chain, Kinematics};
use metrology::PerAxis;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::coverage::machines::{ARMS_MM, CHAIN, Cubic, record};
use crate::coverage::{Coverage, true_coefficients};

const MACHINES: u64 = 100;
const CERTIFICATE: PlateCertificate = PlateCertificate {
    scale: 4e-6,
    squareness_rad: 3e-6,
};

fn identified(recordings: &[Recording], certificate: PlateCertificate) -> Identification {
    let chain: Chain = CHAIN.parse().unwrap();
    let mut options = IdentifyOptions::of_chain(&chain, &PerAxis::default(), 3);
    options.disturbed = Disturbed::Ignored;
    options.certificate = certificate;
    let kinematics = Kinematics::of_chain(chain, PerAxis::default());
    identify(&kinematics, recordings, &options).unwrap()
}

/// As a plate reads that is `scale` too short for its figures and whose u and v are not square to each other.
fn read_by(plate: PlateCertificate, recordings: &mut [Recording]) {
    for point in recordings.iter_mut().flat_map(|r| &mut r.points) {
        let [u, v] = point.reading_mm;
        point.reading_mm = [
            u + plate.scale * u + 0.5 * plate.squareness_rad * v,
            v + plate.scale * v + 0.5 * plate.squareness_rad * u,
        ];
    }
}

#[test]
fn val_a_plate_that_is_too_long_is_held_by_the_interval() {
    let mut rng = Pcg64Mcg::seed_from_u64(77);
    let recordings = record(&Cubic::random(&mut rng), &ARMS_MM, &mut rng);
    let plain = identified(&recordings, PlateCertificate::EXACT);
    for plate in [
        PlateCertificate {
            squareness_rad: 0.0,
            ..CERTIFICATE
        },
        PlateCertificate {
            scale: 0.0,
            ..CERTIFICATE
        },
    ] {
        let mut bent = recordings.clone();
        read_by(plate, &mut bent);
        let moved = identified(&bent, PlateCertificate::EXACT);
        let allowed = identified(&recordings, plate);
        let mut greatest_mm = 0.0_f64;
        for idx in 0..plain.n_coefficients {
            let moved_mm = (moved.values[idx] - plain.values[idx]).abs() / plain.scale[idx];
            let added = allowed.covariance[(idx, idx)] - plain.covariance[(idx, idx)];
            let added_mm = added.max(0.0).sqrt() / plain.scale[idx];
            greatest_mm = greatest_mm.max(moved_mm);
            // A difference of variances keeps half of the digits.
            assert!((moved_mm - added_mm).abs() < 1e-6, "{moved_mm} {added_mm}");
        }
        println!("moved by up to {:.3} µm", 1e3 * greatest_mm);
        assert!(greatest_mm > 2e-4);
    }
}

#[test]
fn intervals_hold_the_truth_for_plates_of_the_certificate() {
    let (mut with, mut without) = (Coverage::default(), Coverage::default());
    for seed in 0..MACHINES {
        let mut rng = Pcg64Mcg::seed_from_u64(2_000 + seed);
        let truth = Cubic::random(&mut rng);
        let mut recordings = record(&truth, &ARMS_MM, &mut rng);
        let [scale, squareness]: [f64; 2] = [(); 2].map(|()| StandardNormal.sample(&mut rng));
        read_by(
            PlateCertificate {
                scale: scale * CERTIFICATE.scale,
                squareness_rad: squareness * CERTIFICATE.squareness_rad,
            },
            &mut recordings,
        );
        let fits = [CERTIFICATE, PlateCertificate::EXACT].map(|c| identified(&recordings, c));
        let values = true_coefficients(&truth, &fits[0]);
        for (fit, coverage) in fits.iter().zip([&mut with, &mut without]) {
            for (idx, value) in values.iter().enumerate() {
                let (estimate, u) = fit.estimate(idx).unwrap();
                coverage.ask(estimate - value, u);
            }
        }
    }
    println!(
        "without the certificate {} of {}",
        without.held, without.asked
    );
    assert!(without.held * 100 < without.asked * 93, "{}", without.held);
    with.check("coefficients read by plates of the certificate");
}
