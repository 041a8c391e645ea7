//! Each of the 21 geometric errors alone and compensated alone: what is left of the truth, and what the
//! wrong sign makes of it.
//!
//! The plant has its own chain of bodies; what is published about it follows from the definition of the
//! component alone: the motion of the tool against the workpiece, so that a body which carries the
//! workpiece enters with the opposite of its own motion. The compensation is that of the machine model.

use machine::volumetric::VolumetricModel;
use machine::{Kinematics, MachineFile};
use metrology::drift::Extrapolate;
use metrology::sample::{CurveForm, ErrorCurve, GeometryModel};
use metrology::{Axis, ErrorComponent, PerAxis, Stamp};
use nalgebra::{DMatrix, Vector3};

use super::super::super::file::PlantFile;
use super::super::super::network::Network;
use super::super::super::structure::Structure;
use super::{Body, CHAINS, MACHINE, PLANT, Rig};

const KNOTS: usize = 161;
/// Share of the error that may be left: the table's chords, and what slopes of the error make of one step.
const LEFT: f64 = 0.01;
const POSES: [[f64; 3]; 4] = [
    [170.0, -120.0, 210.0],
    [-230.0, 90.0, 60.0],
    [60.0, 150.0, 330.0],
    [-90.0, -180.0, 140.0],
];

/// The plant with linear axes alone that turn about their frames' own origins, every error taken away but
/// what `keep` leaves.
fn bare(chain: &str, keep: impl Fn(&mut PlantFile, &mut Vec<(Axis, usize)>)) -> Rig {
    let mut machine = MachineFile::parse(MACHINE, "bench.yaml").unwrap();
    machine.chain = chain.to_owned();
    machine.axes.retain(|axis, _| axis.is_linear());
    let mut truth = PlantFile::from_yaml(PLANT).unwrap();
    for entry in truth.geometry.linear.values_mut() {
        entry.lead_um_per_m = 0.0;
        entry.carriage_mm = [0.0; 3];
    }
    let squareness = &mut truth.geometry.squareness_urad;
    (squareness.y_to_x, squareness.z_to_x, squareness.z_to_y) = (0.0, 0.0, 0.0);
    let mut kept = Vec::new();
    keep(&mut truth, &mut kept);
    let mut body = Body::new(&machine, &truth.geometry, 11).unwrap();
    for joint in body.tool_side.iter_mut().chain(&mut body.workpiece_side) {
        let own = kept.iter().find(|(axis, _)| *axis == joint.joint.axis);
        joint.errors.keep(own.map(|(_, component)| *component));
    }
    let network = Network::soaked(20.0);
    let structure = Structure::new(&truth.structure, 20.0, 150.0, &network).unwrap();
    Rig { body, structure }
}

fn model(chain: &str, curve: ErrorCurve) -> VolumetricModel {
    let kinematics = Kinematics::of_chain(chain.parse().unwrap(), PerAxis::default());
    let published = GeometryModel {
        at: Stamp::from_nanos(0),
        chain: chain.to_owned(),
        covariance: DMatrix::zeros(curve.coefficient.len(), curve.coefficient.len()),
        curves: vec![curve],
        combinations: Vec::new(),
        n_samples: 1,
        n_unknowns: 1,
        rank: 1,
        residual_standard_deviation_mm: 0.0,
        sequence: 1,
    };
    VolumetricModel::new(&kinematics, &published)
        .unwrap()
        .with_extrapolate(Extrapolate::Refuse)
}

fn curve(
    component: ErrorComponent,
    form: CurveForm,
    position: Vec<f64>,
    coefficient: Vec<f64>,
) -> ErrorCurve {
    ErrorCurve {
        component,
        form,
        origin: 0.0,
        power: Vec::new(),
        span: (-400.0, 400.0),
        standard_uncertainty: vec![0.0; coefficient.len()],
        estimable: vec![true; coefficient.len()],
        position,
        coefficient,
    }
}

/// Truth without compensation, with it, and with its sign turned: root of the mean square over the poses, mm.
fn seen_mm(rig: &Rig, model: &VolumetricModel, tool_offset_mm: &Vector3<f64>) -> [f64; 3] {
    [0.0, 1.0, -1.0].map(|share| {
        let squares = POSES.map(|[x, y, z]| {
            let at = PerAxis([x, y, z, 0.0, 0.0, 0.0]);
            let offset = model.command_offset(&at, tool_offset_mm).unwrap();
            let moved = PerAxis::from_fn(|axis| at[axis] + share * offset[axis]);
            let tool = rig.body.workpiece_from_tool(&moved, &rig.structure);
            let tip_mm = tool * nalgebra::Point3::from(*tool_offset_mm);
            (tip_mm.coords - rig.body.nominal_tip_mm(&at) - tool_offset_mm).norm_squared()
        });
        (squares.iter().sum::<f64>() / POSES.len() as f64).sqrt()
    })
}

fn check(name: &str, [without, with, wrong]: [f64; 3]) {
    assert!(
        without > 5e-5,
        "{name}: {without} mm must be worth the work"
    );
    assert!(
        with < LEFT * without,
        "{name}: {with} mm left of {without} mm"
    );
    let twice = wrong / without;
    assert!(
        (twice - 2.0).abs() < 2.0 * LEFT,
        "{name}: the wrong sign makes {twice} times the error"
    );
}

#[test]
fn each_of_the_18_error_motions_compensated_alone_leaves_nothing_of_itself() {
    let mut n = 0;
    for chain in CHAINS {
        let (workpiece_side, _) = super::sides(chain);
        for of in Axis::LINEAR {
            for (place, direction) in Axis::ALL.into_iter().enumerate() {
                let rig = bare(chain, |_, kept| kept.push((of, place)));
                let sign = if workpiece_side.contains(&of) {
                    -1.0
                } else {
                    1.0
                };
                let knots: Vec<f64> = (0..KNOTS).map(|k| k as f64 * 5.0 - 400.0).collect();
                let values = knots.iter().map(|q| sign * rig.drawn(of, place, *q));
                let component = ErrorComponent::motion(direction, of);
                let values = values.collect();
                let model = model(chain, curve(component, CurveForm::Table, knots, values));
                let arm_mm = Vector3::new(60.0, -40.0, -90.0);
                check(
                    &format!("{chain} {component}"),
                    seen_mm(&rig, &model, &arm_mm),
                );
                // Without an offset some turns do not move the tip at all, and then nothing may be done.
                let [without, with, wrong] = seen_mm(&rig, &model, &Vector3::zeros());
                let name = format!("{chain} {component} without an offset");
                if without > 1e-9 {
                    check(&name, [without, with, wrong]);
                } else {
                    assert!(with < 1e-9 && wrong < 1e-9, "{name}: {with} {wrong}");
                }
                n += 1;
            }
        }
    }
    assert_eq!(n, CHAINS.len() * 18);
}

#[test]
fn each_of_the_3_squareness_errors_compensated_alone_leaves_nothing_of_itself() {
    // +Y that leans towards +X is turned right-handed about -Z; +Z towards +X about +Y; +Z towards +Y about -X.
    let leans = [("EC0Y", -20e-6), ("EB0Z", 20e-6), ("EA0Z", -20e-6)];
    for chain in CHAINS {
        for (name, value_rad) in leans {
            let rig = bare(chain, |truth, _| {
                let squareness = &mut truth.geometry.squareness_urad;
                match name {
                    "EC0Y" => squareness.y_to_x = 20.0,
                    "EB0Z" => squareness.z_to_x = 20.0,
                    _ => squareness.z_to_y = 20.0,
                }
            });
            let component = name.parse().unwrap();
            let one = curve(component, CurveForm::Constant, Vec::new(), vec![value_rad]);
            let seen = seen_mm(&rig, &model(chain, one), &Vector3::new(0.0, 0.0, -120.0));
            check(&format!("{chain} {name}"), seen);
        }
    }
}
