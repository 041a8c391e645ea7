//! What heat does to column, head, bed and table.
//!
//! ```text
//!   k_x = a (T_front - T_rear) / depth,  k_y = a (T_right - T_left) / width    (1)  curvature
//!   carriage at height h:  d = (-k_y h^2/2, +k_x h^2/2, a (T_mean - T_ref) h),
//!                          w = (-k_x h, -k_y h, 0)                              (2)
//!   nose against carriage: d_y = -a dT_head overhang,
//!     d_z = -a dT_head drop - a_s [(dT_front + dT_rear)/2 l_bearings + dT_front l_nose]   (3)
//!   bed: d_y = a dT_bed l of the column against the table; k_b = a (T_bed - T_base)/depth;
//!        table moved by -y:  d_z = -k_b y^2/2,  w_x = k_b y                     (4)
//!   table disc, hot at its centre, dT(r) = dT_edge + dT_c (1 - (r/R)^2):
//!     u(r) = a_t r dT_edge + a_t dT_c [(1+n)(r/2 - r^3/(4 R^2)) + (1-n) r/4]     (5)
//! ```
//!
//! A beam bends away from its warmer side (1): the column stands behind the table (+Y) and its warm
//! front tips it backwards. (2) is that of a cantilever with constant curvature. (5) is the free
//! disc under plane stress, n Poisson's ratio \[1\]; outside the disc the rim's growth goes on
//! radially. The head's carriage stands at `carriage_height_mm` plus Z where the chain moves the head,
//! and at `carriage_height_mm` where it moves the table in Z.
//!
//! # Holds when
//! Gradients are linear through each section. Not modelled: warping of the head, guide-way bearings.
//!
//! # References
//! \[1\] S. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed., 1970, art. 150 (from memory).

use nalgebra::{Rotation3, Vector3};

use super::chain::{Rigid, shift, turn_about};
use super::error::{PlantError, require_finite, require_not_negative, require_positive};
use super::file::{Place, StructureEntry};
use super::network::Network;

const POISSON: f64 = 0.29;
const PER_MICRO: f64 = 1e-6;

/// The structure with the temperatures of the last heat step turned into deformations.
#[derive(Clone, Debug)]
pub(super) struct Structure {
    entry: StructureEntry,
    reference_degc: f64,
    /// From carriage to the ball's or tool's tip, mm.
    tip_from_carriage_mm: Vector3<f64>,
    curvature_x_per_mm: f64,
    curvature_y_per_mm: f64,
    column_strain: f64,
    nose_mm: Vector3<f64>,
    bed_mm: f64,
    bed_curvature_per_mm: f64,
    table_rise_mm: f64,
    edge_strain: f64,
    centre_strain: f64,
    workpiece_strain: f64,
    post_strain: f64,
    pub(super) scale_strain: f64,
}

/// What stands on the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    Workpiece,
    Artefact,
}

impl Structure {
    pub(super) fn new(
        entry: &StructureEntry,
        reference_degc: f64,
        tool_length_mm: f64,
        network: &Network,
    ) -> Result<Self, PlantError> {
        check(entry)?;
        let below_carriage = entry.head_drop_mm
            + entry.shaft_between_bearings_mm
            + entry.shaft_nose_mm
            + tool_length_mm;
        let mut structure = Self {
            tip_from_carriage_mm: Vector3::new(0.0, -entry.overhang_mm, -below_carriage),
            reference_degc,
            entry: entry.clone(),
            curvature_x_per_mm: 0.0,
            curvature_y_per_mm: 0.0,
            column_strain: 0.0,
            nose_mm: Vector3::zeros(),
            bed_mm: 0.0,
            bed_curvature_per_mm: 0.0,
            table_rise_mm: 0.0,
            edge_strain: 0.0,
            centre_strain: 0.0,
            workpiece_strain: 0.0,
            post_strain: 0.0,
            scale_strain: 0.0,
        };
        structure.follow(network);
        Ok(structure)
    }

    /// Takes the temperatures over.
    pub(super) fn follow(&mut self, network: &Network) {
        let entry = &self.entry;
        let above = |place| network.temp_degc(place) - self.reference_degc;
        let casting = entry.casting_expansion_um_per_m_k * PER_MICRO;
        let shaft = entry.shaft_expansion_um_per_m_k * PER_MICRO;
        let (front, rear) = (above(Place::ColumnFront), above(Place::ColumnRear));
        let (left, right) = (above(Place::ColumnLeft), above(Place::ColumnRight));
        self.curvature_x_per_mm = casting * (front - rear) / entry.column_depth_mm; // (1)
        self.curvature_y_per_mm = casting * (right - left) / entry.column_width_mm;
        self.column_strain = casting * 0.25 * (front + rear + left + right);
        let (nose_k, tail_k) = (above(Place::SpindleFront), above(Place::SpindleRear));
        let growth = 0.5 * (nose_k + tail_k) * entry.shaft_between_bearings_mm
            + nose_k * entry.shaft_nose_mm;
        let head = casting * above(Place::Head);
        self.nose_mm = Vector3::new(
            0.0,
            -head * entry.overhang_mm,
            -head * entry.head_drop_mm - shaft * growth,
        ); // (3)
        self.bed_mm = casting * above(Place::Bed) * entry.bed_length_mm; // (4)
        self.bed_curvature_per_mm =
            casting * (above(Place::Bed) - above(Place::BedBase)) / entry.bed_depth_mm;
        let table = entry.table_expansion_um_per_m_k * PER_MICRO;
        self.table_rise_mm = table * above(Place::Table) * entry.table_height_mm;
        self.edge_strain = table * above(Place::Table);
        self.centre_strain = table * (above(Place::TableCentre) - above(Place::Table));
        self.workpiece_strain =
            entry.workpiece_expansion_um_per_m_k * PER_MICRO * above(Place::Workpiece);
        self.post_strain = entry.post_expansion_um_per_m_k * PER_MICRO * above(Place::Posts);
        self.scale_strain = entry.scale_expansion_um_per_m_k * PER_MICRO * above(Place::Bed);
    }

    /// Motion of the tool's end by column, head and bed, with the head `z_mm` above its zero.
    pub(super) fn tool_side(&self, z_mm: f64) -> Rigid {
        let height_mm = self.entry.carriage_height_mm + z_mm;
        let half_square = 0.5 * height_mm * height_mm;
        let carriage_mm = Vector3::new(
            -self.curvature_y_per_mm * half_square,
            self.curvature_x_per_mm * half_square + self.bed_mm,
            self.column_strain * height_mm,
        ); // (2)
        let turn = Rotation3::new(Vector3::new(
            -self.curvature_x_per_mm * height_mm,
            -self.curvature_y_per_mm * height_mm,
            0.0,
        ));
        // The tip is the origin of this frame; the carriage, about which the head turns, is not.
        shift(carriage_mm + self.nose_mm) * turn_about(&-self.tip_from_carriage_mm, &turn)
    }

    /// Motion of the table by the bed, with the table's slide at `y_mm` (the table itself is at -Y).
    pub(super) fn workpiece_side(&self, y_mm: f64) -> Rigid {
        let tilt = Rotation3::new(Vector3::new(self.bed_curvature_per_mm * y_mm, 0.0, 0.0));
        let drop_mm = 0.5 * self.bed_curvature_per_mm * y_mm * y_mm; // (4)
        shift(Vector3::new(0.0, 0.0, self.table_rise_mm - drop_mm))
            * turn_about(&Vector3::new(0.0, 0.0, self.entry.table_top_mm), &tilt)
    }

    /// How far a point that rides on the table is from its cold place, workpiece frame, mm.
    pub(super) fn on_table_mm(&self, point_mm: &Vector3<f64>, standing: Standing) -> Vector3<f64> {
        let radius_mm = point_mm.x.hypot(point_mm.y);
        let rim_mm = self.entry.table_radius_mm;
        let inside_mm = radius_mm.min(rim_mm);
        let hot_centre_mm = self.centre_strain
            * ((1.0 + POISSON) * (0.5 * inside_mm - 0.25 * inside_mm.powi(3) / (rim_mm * rim_mm))
                + (1.0 - POISSON) * 0.25 * inside_mm); // (5)
        let per_radius = if inside_mm > 0.0 {
            hot_centre_mm / inside_mm
        } else {
            0.0
        };
        let lateral = self.edge_strain + per_radius;
        let upright = match standing {
            Standing::Workpiece => self.workpiece_strain,
            Standing::Artefact => self.post_strain,
        };
        Vector3::new(
            lateral * point_mm.x,
            lateral * point_mm.y,
            upright * (point_mm.z - self.entry.table_top_mm),
        )
    }
}

fn check(entry: &StructureEntry) -> Result<(), PlantError> {
    let at = |key: &str| format!("structure.{key}");
    require_finite(at("table_top_mm"), entry.table_top_mm)?;
    for (key, value) in [
        ("column_depth_mm", entry.column_depth_mm),
        ("column_width_mm", entry.column_width_mm),
        ("bed_depth_mm", entry.bed_depth_mm),
        ("table_radius_mm", entry.table_radius_mm),
    ] {
        require_positive(at(key), value)?;
    }
    for (key, value) in [
        (
            "casting_expansion_um_per_m_k",
            entry.casting_expansion_um_per_m_k,
        ),
        ("carriage_height_mm", entry.carriage_height_mm),
        ("overhang_mm", entry.overhang_mm),
        ("head_drop_mm", entry.head_drop_mm),
        (
            "shaft_expansion_um_per_m_k",
            entry.shaft_expansion_um_per_m_k,
        ),
        ("shaft_between_bearings_mm", entry.shaft_between_bearings_mm),
        ("shaft_nose_mm", entry.shaft_nose_mm),
        ("bed_length_mm", entry.bed_length_mm),
        ("table_height_mm", entry.table_height_mm),
        (
            "table_expansion_um_per_m_k",
            entry.table_expansion_um_per_m_k,
        ),
        (
            "workpiece_expansion_um_per_m_k",
            entry.workpiece_expansion_um_per_m_k,
        ),
        ("post_expansion_um_per_m_k", entry.post_expansion_um_per_m_k),
        (
            "scale_expansion_um_per_m_k",
            entry.scale_expansion_um_per_m_k,
        ),
    ] {
        require_not_negative(at(key), value)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cold() -> Structure {
        let entry = StructureEntry {
            casting_expansion_um_per_m_k: 11.0,
            carriage_height_mm: 600.0,
            column_depth_mm: 500.0,
            column_width_mm: 700.0,
            overhang_mm: 400.0,
            head_drop_mm: 100.0,
            shaft_expansion_um_per_m_k: 12.0,
            shaft_between_bearings_mm: 200.0,
            shaft_nose_mm: 50.0,
            bed_length_mm: 500.0,
            bed_depth_mm: 400.0,
            table_height_mm: 300.0,
            table_radius_mm: 300.0,
            table_top_mm: 0.0,
            table_expansion_um_per_m_k: 11.0,
            workpiece_expansion_um_per_m_k: 23.0,
            post_expansion_um_per_m_k: 12.0,
            scale_expansion_um_per_m_k: 8.0,
        };
        let network = Network::soaked(20.0);
        Structure::new(&entry, 20.0, 150.0, &network).unwrap()
    }

    fn warm(kelvin: &[(Place, f64)]) -> Structure {
        let mut network = Network::soaked(20.0);
        for &(place, above_k) in kelvin {
            network.set_degc(place, 20.0 + above_k);
        }
        let mut structure = cold();
        structure.follow(&network);
        structure
    }

    fn tip_mm(structure: &Structure, z_mm: f64) -> Vector3<f64> {
        structure.tool_side(z_mm).translation.vector
    }

    #[test]
    fn a_soaked_machine_is_not_bent() {
        let structure = cold();
        assert!(tip_mm(&structure, 200.0).norm() < 1e-15);
        assert!(structure.workpiece_side(100.0).translation.vector.norm() < 1e-15);
        let point_mm = Vector3::new(200.0, 100.0, 80.0);
        assert!(structure.on_table_mm(&point_mm, Standing::Workpiece).norm() < 1e-15);
    }

    #[test]
    fn eq3_spindle_growth_pushes_the_nose_down() {
        let structure = warm(&[(Place::SpindleFront, 12.0), (Place::SpindleRear, 8.0)]);
        let growth_mm = 12e-6 * (10.0 * 200.0 + 12.0 * 50.0);
        assert!((tip_mm(&structure, 0.0) - Vector3::new(0.0, 0.0, -growth_mm)).norm() < 1e-12);
        let structure = warm(&[(Place::Head, 5.0)]);
        let expected = Vector3::new(0.0, -11e-6 * 5.0 * 400.0, -11e-6 * 5.0 * 100.0);
        assert!((tip_mm(&structure, 300.0) - expected).norm() < 1e-12);
    }

    #[test]
    fn eq2_a_warm_front_tips_the_column_backwards_like_a_bent_beam() {
        let structure = warm(&[(Place::ColumnFront, 1.0), (Place::ColumnRear, -1.0)]);
        let curvature = 11e-6 * 2.0 / 500.0;
        for z_mm in [0.0, 200.0, 400.0] {
            let height_mm = 600.0 + z_mm;
            let angle = curvature * height_mm;
            // Tip from carriage: 400 forward, 100 + 200 + 50 + 150 down.
            let expected = Vector3::new(
                0.0,
                0.5 * curvature * height_mm * height_mm - angle * 500.0,
                angle * 400.0,
            );
            let seen = tip_mm(&structure, z_mm);
            assert!((seen - expected).norm() < 1e-6, "{seen} {expected}");
        }
    }

    #[test]
    fn eq2_a_uniformly_warm_column_only_grows_taller() {
        use Place::{ColumnFront, ColumnLeft, ColumnRear, ColumnRight};
        let structure = warm(&[ColumnFront, ColumnRear, ColumnLeft, ColumnRight].map(|p| (p, 2.0)));
        let expected = Vector3::new(0.0, 0.0, 11e-6 * 2.0 * 750.0);
        assert!((tip_mm(&structure, 150.0) - expected).norm() < 1e-12);
    }

    #[test]
    fn eq4_a_warm_bed_parts_column_and_table_and_arches_under_it() {
        let structure = warm(&[(Place::Bed, 1.0), (Place::BedBase, 0.0)]);
        assert!((tip_mm(&structure, 0.0).y - 11e-6 * 500.0).abs() < 1e-12);
        let curvature = 11e-6 / 400.0;
        let table = structure.workpiece_side(200.0);
        assert!((table.translation.vector.z + 0.5 * curvature * 4e4).abs() < 1e-12);
        // The slope of the arch where the table is: d(-k s^2/2)/ds at s = -200.
        assert!((table.rotation.matrix()[(2, 1)] - curvature * 200.0).abs() < 1e-12);
    }

    #[test]
    fn val_timoshenko_free_disc_with_a_hot_centre() {
        let structure = warm(&[(Place::TableCentre, 4.0)]);
        let at = |radius_mm: f64| {
            structure
                .on_table_mm(&Vector3::new(radius_mm, 0.0, 0.0), Standing::Artefact)
                .x
        };
        // The rim of a free disc grows by the mean temperature, here half of the centre's.
        assert!((at(300.0) - 11e-6 * 2.0 * 300.0).abs() < 1e-12);
        // Quadrature of the plane-stress integrals at half radius.
        let integral = |to_mm: f64| {
            let n = 20_000;
            (0..n)
                .map(|i| {
                    let r = (f64::from(i) + 0.5) * to_mm / f64::from(n);
                    4.0 * (1.0 - (r / 300.0).powi(2)) * r * to_mm / f64::from(n)
                })
                .sum::<f64>()
        };
        let expected = 11e-6
            * ((1.0 + POISSON) / 150.0 * integral(150.0)
                + (1.0 - POISSON) * 150.0 / 9e4 * integral(300.0));
        assert!(
            (at(150.0) - expected).abs() < 1e-9,
            "{} {expected}",
            at(150.0)
        );
    }

    #[test]
    fn posts_and_workpieces_grow_by_their_own_temperatures() {
        let structure = warm(&[(Place::Workpiece, 1.0), (Place::Posts, 2.0)]);
        let point_mm = Vector3::new(0.0, 0.0, 200.0);
        let height = |standing| structure.on_table_mm(&point_mm, standing).z;
        assert!((height(Standing::Workpiece) - 23e-6 * 200.0).abs() < 1e-12);
        assert!((height(Standing::Artefact) - 12e-6 * 2.0 * 200.0).abs() < 1e-12);
    }
}
