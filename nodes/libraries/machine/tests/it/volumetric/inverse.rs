//! Commands that undo the error.

use machine::volumetric::{PoseRefusal, VolumetricModel};
use metrology::drift::Extrapolate;
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use crate::volumetric::bodies::Bodies;
use crate::volumetric::model::{constant, random_model, random_pose};
use crate::volumetric::{CHAINS, machine, model};

/// Tip error that is left when the offset is commanded.
fn left_mm(
    model: &VolumetricModel,
    chain: &str,
    at: &PerAxis<f64>,
    tool: &Vector3<f64>,
    offset: &PerAxis<f64>,
) -> f64 {
    let kinematics = machine(chain);
    let nominal = Bodies {
        kinematics: &kinematics,
        values: Vec::new(),
    };
    let moved = PerAxis::from_fn(|axis| at[axis] + offset[axis]);
    let actual = nominal.tip(&moved, tool) + model.tip_error_mm(&moved, tool).unwrap();
    (actual - nominal.tip(at, tool)).norm()
}

#[test]
fn eq2_one_step_suffices_for_errors_of_50_um_and_100_urad() {
    let mut rng = Pcg64Mcg::seed_from_u64(31);
    let (mut raw, mut once, mut whole) = (0.0_f64, 0.0_f64, 0.0_f64);
    for chain in CHAINS {
        let kinematics = machine(chain);
        for _ in 0..20 {
            let published = random_model(&kinematics, 0.05, 1e-4, &mut rng);
            let found = VolumetricModel::new(&kinematics, &published).unwrap();
            let found = found.with_extrapolate(Extrapolate::Linear);
            for _ in 0..20 {
                let (at, tool) = random_pose(&mut rng);
                let Ok(offset) = found.command_offset(&at, &tool) else {
                    assert!(chain == "[w X' C' Y' b Z B t]", "{chain}");
                    continue;
                };
                let exact = found.exact_command_offset(&at, &tool).unwrap();
                assert!(offset.0[3..].iter().all(|turn| *turn == 0.0));
                raw = raw.max(found.tip_error_mm(&at, &tool).unwrap().norm());
                if chain != "[w X' C' Y' b Z B t]" {
                    once = once.max(left_mm(&found, chain, &at, &tool, &offset));
                }
                whole = whole.max(left_mm(&found, chain, &at, &tool, &exact));
            }
        }
    }
    eprintln!("error {raw:.4} mm, after one step {once:e} mm, iterated {whole:e} mm");
    assert!(raw > 0.1);
    assert!(once < 2e-4, "{once:e}");
    assert!(whole < 1e-11, "{whole:e}");
}

#[test]
fn a_turned_table_is_compensated_in_machine_directions() {
    let chain = "[w C' A' Y' b X Z t]";
    let published = model(chain, vec![constant("EXX", 0.01)]);
    let found = VolumetricModel::new(&machine(chain), &published).unwrap();
    let quarter = std::f64::consts::FRAC_PI_2;
    let at = PerAxis([10.0, 20.0, 30.0, 0.0, 0.0, quarter]);
    let error = found.tip_error_mm(&at, &Vector3::zeros()).unwrap();
    assert!(
        (error - Vector3::new(0.0, -0.01, 0.0)).norm() < 1e-12,
        "{error}"
    );
    let offset = found.command_offset(&at, &Vector3::zeros()).unwrap();
    assert!((offset[Axis::X] + 0.01).abs() < 1e-12);
    assert!(offset[Axis::Y].abs() < 1e-12 && offset[Axis::Z].abs() < 1e-12);
}

#[test]
fn axes_turned_into_one_plane_cannot_reach() {
    let chain = "[w X' C' Y' b Z B t]";
    let found = VolumetricModel::new(&machine(chain), &model(chain, Vec::new())).unwrap();
    let mut at = PerAxis::default();
    assert!(found.command_offset(&at, &Vector3::zeros()).is_ok());
    at[Axis::C] = std::f64::consts::FRAC_PI_2;
    let refused = Err(PoseRefusal::NotReachable);
    assert_eq!(found.command_offset(&at, &Vector3::zeros()), refused);
    assert_eq!(found.exact_command_offset(&at, &Vector3::zeros()), refused);
}

#[test]
fn a_pose_at_the_end_of_the_span_is_compensated_beyond_it() {
    let mut rng = Pcg64Mcg::seed_from_u64(37);
    let chain = "[w X' Y' b Z t]";
    let kinematics = machine(chain);
    let published = random_model(&kinematics, 0.05, 1e-4, &mut rng);
    let found = VolumetricModel::new(&kinematics, &published).unwrap();
    let corner = PerAxis([300.0, -300.0, 300.0, 0.0, 0.0, 0.0]);
    assert!(
        found
            .exact_command_offset(&corner, &Vector3::zeros())
            .is_ok()
    );
    let mut outside = corner;
    outside[Axis::Z] = 300.001;
    assert!(matches!(
        found.exact_command_offset(&outside, &Vector3::zeros()),
        Err(PoseRefusal::OutOfSpan { axis: Axis::Z, .. })
    ));
}
