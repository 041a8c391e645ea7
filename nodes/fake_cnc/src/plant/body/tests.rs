//! Each of the 21 geometric errors alone: seen in the truth, with its sign, its lever and the scale.
//!
//! What is expected is written down per chain from small displacements, without rigid motions: a body
//! that is shifted by d and turned by w about its carriage c moves its point p by d + w x (p - c). A
//! body on the tool side moves the tool so; one on the workpiece side moves the workpiece, and the tool
//! against it the other way. `compensated` takes each away again by its published component.

mod compensated;

use machine::MachineFile;
use metrology::{Axis, PerAxis};
use nalgebra::{Point3, Vector3};

use super::super::file::PlantFile;
use super::super::network::Network;
use super::super::structure::Structure;
use super::Body;

const MACHINE: &str = include_str!("../../../../libraries/machine/tests/data/bench.yaml");
const PLANT: &str = include_str!("../../../../../launch_configs/first_run/plant.yaml");
/// Of the error's own size: what is left is of second order.
const SECOND_ORDER: f64 = 2e-4;

struct Rig {
    body: Body,
    structure: Structure,
}

/// The bench with linear axes alone, without any error but the drawn component `kept` of `of`.
fn rig(chain: &str, of: Axis, kept: Option<usize>) -> Rig {
    let mut machine = MachineFile::parse(MACHINE, "bench.yaml").unwrap();
    machine.chain = chain.to_owned();
    machine.axes.retain(|axis, _| axis.is_linear());
    let mut truth = PlantFile::from_yaml(PLANT).unwrap();
    for entry in truth.geometry.linear.values_mut() {
        entry.lead_um_per_m = 0.0;
    }
    let squareness = &mut truth.geometry.squareness_urad;
    (squareness.y_to_x, squareness.z_to_x, squareness.z_to_y) = (0.0, 0.0, 0.0);
    let mut body = Body::new(&machine, &truth.geometry, 11).unwrap();
    for joint in body.tool_side.iter_mut().chain(&mut body.workpiece_side) {
        joint.errors.keep(kept.filter(|_| joint.joint.axis == of));
    }
    let network = Network::soaked(20.0);
    let structure = Structure::new(&truth.structure, 20.0, 150.0, &network).unwrap();
    Rig { body, structure }
}

impl Rig {
    /// Displacement of the point `offset` from the tip against the workpiece, mm.
    fn error_mm(&self, at: &PerAxis<f64>, offset: &Vector3<f64>) -> Vector3<f64> {
        let tool = self.body.workpiece_from_tool(at, &self.structure);
        (tool * Point3::from(*offset)).coords - self.body.nominal_tip_mm(at) - offset
    }

    /// Drawn value of a component of `of` at `q`: mm, or rad.
    fn drawn(&self, of: Axis, component: usize, q: f64) -> f64 {
        let mut joints = self.body.tool_side.iter().chain(&self.body.workpiece_side);
        let joint = joints.find(|joint| joint.joint.axis == of).unwrap();
        let (shift_mm, turn_rad) = joint.errors.at(q);
        if component < 3 {
            shift_mm[component]
        } else {
            turn_rad[component - 3]
        }
    }
}

/// Axes from workpiece to tool, those on the workpiece side first, and the carriage of each.
fn sides(chain: &str) -> (Vec<Axis>, Vec<Axis>) {
    let (workpiece, tool) = chain.split_once(" b").unwrap();
    let axes = |text: &str| {
        let letters = text.chars().filter_map(|c| c.to_string().parse().ok());
        letters.collect::<Vec<Axis>>()
    };
    (axes(workpiece), axes(tool))
}

fn carriage_mm(of: Axis) -> Vector3<f64> {
    let truth = PlantFile::from_yaml(PLANT).unwrap();
    Vector3::from(truth.geometry.linear[&of].carriage_mm)
}

/// Where the measured point lies in the frame of the body that `of` carries, and the sign with which
/// that body moves the tool against the workpiece.
fn lever(chain: &str, of: Axis, at: &PerAxis<f64>, offset: &Vector3<f64>) -> (Vector3<f64>, f64) {
    let (workpiece, tool) = sides(chain);
    let along = |axis: &Axis| {
        let mut unit = Vector3::zeros();
        unit[axis.index()] = at[*axis];
        unit
    };
    if let Some(place) = tool.iter().position(|axis| *axis == of) {
        let beyond: Vector3<f64> = tool[place + 1..].iter().map(along).sum();
        return (beyond + offset, 1.0);
    }
    // In the workpiece the point is at x, y, z; bodies between it and `of` have moved it back.
    let place = workpiece.iter().position(|axis| *axis == of).unwrap();
    let whole: Vector3<f64> = Axis::LINEAR.iter().map(along).sum();
    let inner: Vector3<f64> = workpiece[..place].iter().map(along).sum();
    (whole + offset - inner, -1.0)
}

const CHAINS: [&str; 4] = [
    "[w X' Y' b Z t]",
    "[w Y' X' b Z t]",
    "[w b X Y Z t]",
    "[w Y' b X Z t]",
];

#[test]
fn each_of_the_18_error_motions_acts_alone_with_its_sign_and_lever() {
    let at = PerAxis([170.0, -120.0, 210.0, 0.0, 0.0, 0.0]);
    let mut seen = 0;
    for chain in CHAINS {
        for of in Axis::LINEAR {
            for component in 0..6 {
                let rig = rig(chain, of, Some(component));
                let value = rig.drawn(of, component, at[of]);
                let mut greatest = 0.0_f64;
                for offset in [Vector3::zeros(), Vector3::new(60.0, -40.0, -90.0)] {
                    let (point_mm, sign) = lever(chain, of, &at, &offset);
                    let mut unit = Vector3::zeros();
                    unit[component % 3] = value;
                    let expected = if component < 3 {
                        unit
                    } else {
                        unit.cross(&(point_mm - carriage_mm(of)))
                    } * sign;
                    let error = rig.error_mm(&at, &offset);
                    let arm_mm = (point_mm - carriage_mm(of)).norm();
                    let size = value.abs() * arm_mm.max(1.0);
                    let left = (error - expected).norm();
                    assert!(
                        left < SECOND_ORDER * size,
                        "{chain} {of} {component}: {error}"
                    );
                    greatest = greatest.max(expected.norm());
                    seen += 1;
                }
                assert!(
                    greatest > 1e-5,
                    "{chain} {of} {component}: it must be there"
                );
            }
        }
    }
    assert_eq!(seen, CHAINS.len() * 18 * 2);
}

#[test]
fn each_of_the_3_squareness_errors_leans_its_axis() {
    let machine = {
        let mut machine = MachineFile::parse(MACHINE, "bench.yaml").unwrap();
        machine.chain = "[w X' Y' b Z t]".to_owned();
        machine.axes.retain(|axis, _| axis.is_linear());
        machine
    };
    let at = PerAxis([170.0, -120.0, 210.0, 0.0, 0.0, 0.0]);
    let lean = |which: usize| {
        let mut truth = PlantFile::from_yaml(PLANT).unwrap();
        for entry in truth.geometry.linear.values_mut() {
            entry.lead_um_per_m = 0.0;
        }
        let squareness = &mut truth.geometry.squareness_urad;
        let pick = |index| if which == index { 20.0 } else { 0.0 };
        (squareness.y_to_x, squareness.z_to_x) = (pick(0), pick(1));
        squareness.z_to_y = pick(2);
        let mut body = Body::new(&machine, &truth.geometry, 11).unwrap();
        for joint in body.tool_side.iter_mut().chain(&mut body.workpiece_side) {
            joint.errors.keep(None);
        }
        let network = Network::soaked(20.0);
        let structure = Structure::new(&truth.structure, 20.0, 150.0, &network).unwrap();
        Rig { body, structure }.error_mm(&at, &Vector3::zeros())
    };
    // An axis that leans towards another carries the tool that way as it goes, on either side.
    let expected = [
        Vector3::new(-120.0 * 20e-6, 0.0, 0.0),
        Vector3::new(210.0 * 20e-6, 0.0, 0.0),
        Vector3::new(0.0, 210.0 * 20e-6, 0.0),
    ];
    for (which, expected) in expected.into_iter().enumerate() {
        assert!(
            (lean(which) - expected).norm() < 1e-9,
            "{which}: {}",
            lean(which)
        );
    }
}

#[test]
fn a_scale_sees_the_slides_own_positioning_with_the_sign_of_the_truth_and_no_turn() {
    let at = PerAxis([170.0, -120.0, 210.0, 0.0, 0.0, 0.0]);
    for chain in CHAINS {
        for of in Axis::LINEAR {
            let rig = rig(chain, of, Some(of.index()));
            let truth_mm = rig.error_mm(&at, &Vector3::zeros())[of.index()];
            let seen_mm = rig.body.along_error_mm(of, at[of]);
            assert!(
                (truth_mm - seen_mm).abs() < 1e-9,
                "{chain} {of}: {truth_mm} {seen_mm}"
            );
        }
    }
    let rig = rig("[w X' Y' b Z t]", Axis::X, Some(5));
    assert!(
        rig.error_mm(&at, &Vector3::zeros()).norm() > 1e-4,
        "yaw moves the tool"
    );
    assert!(
        rig.body.along_error_mm(Axis::X, 170.0).abs() < 1e-12,
        "the scale does not see it"
    );
}
