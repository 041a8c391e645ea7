//! Blocks and artefacts of a machine file as solid bodies.

use machine::MachineFile;
use nalgebra::Vector3;

/// Signed distance from a point to something solid, mm.
pub enum Body {
    Box {
        least: Vector3<f64>,
        greatest: Vector3<f64>,
    },
    Sphere(Vector3<f64>, f64),
    /// A vertical cylinder up to a height.
    Pin(Vector3<f64>, f64, f64),
    /// Everything outside a vertical hole, up to a height and an outer radius.
    Ring(Vector3<f64>, f64, f64),
}

impl Body {
    pub fn distance_mm(&self, p: &Vector3<f64>) -> f64 {
        match self {
            Self::Box { least, greatest } => {
                let outside = (least - p).sup(&(p - greatest));
                let positive = outside.map(|d| d.max(0.0)).norm();
                positive + outside.max().min(0.0)
            }
            Self::Sphere(centre, radius) => (p - centre).norm() - radius,
            Self::Pin(centre, radius, top_mm) => {
                let radial = (p - centre).xy().norm() - radius;
                let above = p.z - top_mm;
                radial.max(0.0).hypot(above.max(0.0)) + radial.max(above).min(0.0)
            }
            Self::Ring(centre, radius, top_mm) => {
                let rho = (p - centre).xy().norm();
                let radial = (radius - rho).max(rho - 2.0 * radius);
                let above = p.z - top_mm;
                radial.max(0.0).hypot(above.max(0.0)) + radial.max(above).min(0.0)
            }
        }
    }
}

pub fn bodies(file: &MachineFile) -> Vec<Body> {
    let mut bodies = of_artefacts(file);
    for block in &file.blocks {
        let corner = Vector3::from(block.corner_mm);
        let far = corner + Vector3::from(block.approach_sign.map(|s| 40.0 * f64::from(s)));
        bodies.push(Body::Box {
            least: corner.inf(&far),
            greatest: corner.sup(&far),
        });
    }
    bodies
}

pub fn of_artefacts(file: &MachineFile) -> Vec<Body> {
    use machine::file::ArtefactEntry as Entry;
    let mut bodies: Vec<Body> = Vec::new();
    for artefact in &file.artefacts {
        bodies.push(match artefact {
            Entry::Sphere {
                centre_mm,
                radius_mm,
                ..
            } => Body::Sphere(Vector3::from(*centre_mm), *radius_mm),
            Entry::Bore {
                centre_mm,
                radius_mm,
                ..
            } => Body::Ring(Vector3::from(*centre_mm), *radius_mm, centre_mm[2] + 15.0),
            Entry::Boss {
                centre_mm,
                radius_mm,
                ..
            } => Body::Pin(Vector3::from(*centre_mm), *radius_mm, centre_mm[2] + 30.0),
            Entry::Plane {
                point_mm,
                normal,
                half_side_mm,
                ..
            } => {
                let normal = Vector3::from(*normal);
                let across = normal.map(|n| if n == 0.0 { *half_side_mm + 3.0 } else { 0.0 });
                let near = Vector3::from(*point_mm) + across;
                let far = Vector3::from(*point_mm) - across - normal * 20.0;
                Body::Box {
                    least: near.inf(&far),
                    greatest: near.sup(&far),
                }
            }
        });
    }
    bodies
}

/// Least distance of the ball's centre to any body.
pub fn clearance_mm(bodies: &[Body], centre: &Vector3<f64>) -> f64 {
    let distances = bodies.iter().map(|body| body.distance_mm(centre));
    distances.fold(f64::INFINITY, f64::min)
}
