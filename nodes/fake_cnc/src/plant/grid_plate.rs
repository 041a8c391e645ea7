//! The grid encoder: a plate that is put on the machine, and a head that reads it.
//!
//! ```text
//!   w = R(-rho) (head_uv - plate_uv - offset)                                             (1)
//!   reading = w + e(w) + noise - zero                                                     (2)
//!   e(w) = sum_{k=1..6} a_k sin(kappa_k . w + phi_k) - s w - q/2 (w_v, w_u)                (3)
//! ```
//!
//! head and plate are in the workpiece frame, u and v along the plane's two axes. `offset` and `rho` are
//! drawn at each mounting; e belongs to the plate and goes with it. The head's measuring point rides on
//! the tool, so that the tool's angular errors act on it through the head's offset. s: the graduation is too long; q: its
//! directions u and v are closer to each other than a right angle.
//!
//! The count is incremental: once the head has left the field, or been lifted off, there is no reading
//! until it is set to zero again.
//!
//! # Holds when
//! The plate is flat, parallel to its plane and does not expand (glass ceramic).

use std::f64::consts::TAU;

use machine::file::{GridEncoderEntry, GridPlacement};
use metrology::sample::TestPlane;
use nalgebra::{Point3, Rotation2, Vector2, Vector3};

use super::chain::Rigid;
use super::error::{PlantError, require_finite, require_not_negative, require_positive};
use super::file::GridPlateEntry;
use super::noise::{Effect, Stream};
use super::structure::{Standing, Structure};

const WAVES: usize = 6;

/// What the grid encoder reads, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridReading {
    /// Plane of the plate.
    pub plane: TestPlane,
    /// Along the plane's first axis.
    pub u_mm: f64,
    /// Along its second axis.
    pub v_mm: f64,
    /// Counts zeroings since the start.
    pub zero_id: u32,
}

#[derive(Clone, Debug)]
pub(super) struct GridPlate {
    placements: Vec<GridPlacement>,
    radius_mm: f64,
    resolution_mm: f64,
    gap_mm: f64,
    placement_mm: f64,
    rotation_rad: f64,
    noise_mm: f64,
    scale: f64,
    squareness_rad: f64,
    waves: [Wave; WAVES],
    mounting: Stream,
    head: Stream,
    mounted: Option<Mounted>,
    zero_id: u32,
}

#[derive(Clone, Copy, Debug)]
struct Wave {
    amplitude_mm: Vector2<f64>,
    per_mm: Vector2<f64>,
    phase_rad: f64,
}

#[derive(Clone, Copy, Debug)]
struct Mounted {
    index: usize,
    offset_mm: Vector2<f64>,
    rotation: Rotation2<f64>,
    zero_mm: Option<Vector2<f64>>,
}

impl GridPlate {
    pub(super) fn new(
        machine: &GridEncoderEntry,
        entry: &GridPlateEntry,
        seed: u64,
    ) -> Result<Self, PlantError> {
        check(entry)?;
        require_positive("grid_encoder.resolution_um", machine.resolution_um)?;
        let mut stream = Stream::new(seed, Effect::GridPlate, 0);
        let amplitude_mm = entry.plate_error_um / 1e3 / (WAVES as f64 / 2.0).sqrt();
        let waves = std::array::from_fn(|_| {
            let heading = Rotation2::new(TAU * stream.uniform());
            let wave_mm = entry.plate_error_length_mm * (1.0 + stream.uniform());
            Wave {
                amplitude_mm: amplitude_mm * Vector2::new(stream.normal(), stream.normal()),
                per_mm: heading * Vector2::x() * (TAU / wave_mm),
                phase_rad: TAU * stream.uniform(),
            }
        });
        Ok(Self {
            placements: machine.placements.clone(),
            radius_mm: machine.radius_mm,
            resolution_mm: machine.resolution_um / 1e3,
            gap_mm: entry.gap_tolerance_mm,
            placement_mm: entry.placement_um / 1e3,
            rotation_rad: entry.rotation_urad / 1e6,
            noise_mm: entry.head_noise_um / 1e3,
            scale: entry.plate_scale_um_per_m * 1e-6,
            squareness_rad: entry.plate_squareness_urad * 1e-6,
            waves,
            mounting: Stream::new(seed, Effect::GridPlate, 1),
            head: Stream::new(seed, Effect::GridPlate, 2),
            mounted: None,
            zero_id: 0,
        })
    }

    pub(super) fn has(&self, id: &str) -> bool {
        self.placements.iter().any(|placement| placement.id == id)
    }

    /// Puts the plate at the placement `id`, not zeroed.
    pub(super) fn mount(&mut self, id: &str) {
        let found = self
            .placements
            .iter()
            .position(|placement| placement.id == id);
        let Some(index) = found else { return };
        let offset = Vector2::new(self.mounting.normal(), self.mounting.normal());
        self.mounted = Some(Mounted {
            index,
            offset_mm: offset * self.placement_mm,
            rotation: Rotation2::new(self.mounting.normal() * self.rotation_rad),
            zero_mm: None,
        });
    }

    pub(super) const fn is_mounted(&self) -> bool {
        self.mounted.is_some()
    }

    /// Sets the count to zero where the head is.
    pub(super) fn zero(&mut self, tool: &Rigid, structure: &Structure) {
        self.zero_id += 1;
        let here = self.over_plate_mm(tool, structure);
        let noise = self.noise();
        if let Some(mounted) = &mut self.mounted {
            mounted.zero_mm = here.map(|here| here + noise);
        }
    }

    /// (2), quantised; `None` where there is no count.
    pub(super) fn read(&mut self, tool: &Rigid, structure: &Structure) -> Option<GridReading> {
        let zero_mm = self.mounted?.zero_mm?;
        let Some(here_mm) = self.over_plate_mm(tool, structure) else {
            if let Some(mounted) = &mut self.mounted {
                mounted.zero_mm = None;
            }
            return None;
        };
        let reading_mm = here_mm + self.noise() - zero_mm;
        let counted = |mm: f64| super::quantised(mm, self.resolution_mm);
        let placement = self.placements.get(self.mounted?.index)?;
        Some(GridReading {
            plane: placement.plane.into(),
            u_mm: counted(reading_mm.x),
            v_mm: counted(reading_mm.y),
            zero_id: self.zero_id,
        })
    }

    fn noise(&mut self) -> Vector2<f64> {
        Vector2::new(self.head.normal(), self.head.normal()) * self.noise_mm
    }

    /// (1) and the plate's own error; `None` outside the field.
    fn over_plate_mm(&self, tool: &Rigid, structure: &Structure) -> Option<Vector2<f64>> {
        let mounted = self.mounted.as_ref()?;
        let placement = self.placements.get(mounted.index)?;
        let head = tool * Point3::from(Vector3::from(placement.tool_offset_mm));
        let centre_mm = Vector3::from(placement.centre_mm);
        let plate_mm = centre_mm + structure.on_table_mm(&centre_mm, Standing::Artefact);
        let head_mm = head.coords - plate_mm;
        let [first, second, normal] = placement.plane.axes();
        let in_plane = Vector2::new(head_mm[first.index()], head_mm[second.index()]);
        let on_plate = mounted.rotation.inverse() * (in_plane - mounted.offset_mm);
        let readable =
            on_plate.norm() <= self.radius_mm && head_mm[normal.index()].abs() <= self.gap_mm;
        readable.then(|| on_plate + self.error_mm(&on_plate))
    }

    /// (3).
    fn error_mm(&self, at_mm: &Vector2<f64>) -> Vector2<f64> {
        let half = 0.5 * self.squareness_rad;
        let whole = -self.scale * at_mm - half * Vector2::new(at_mm.y, at_mm.x);
        self.waves.iter().fold(whole, |sum, wave| {
            sum + wave.amplitude_mm * (wave.per_mm.dot(at_mm) + wave.phase_rad).sin()
        })
    }
}

fn check(entry: &GridPlateEntry) -> Result<(), PlantError> {
    let at = |key: &str| format!("grid_encoder.{key}");
    require_positive(at("gap_tolerance_mm"), entry.gap_tolerance_mm)?;
    require_positive(at("plate_error_length_mm"), entry.plate_error_length_mm)?;
    for (key, value) in [
        ("placement_um", entry.placement_um),
        ("rotation_urad", entry.rotation_urad),
        ("plate_error_um", entry.plate_error_um),
        ("head_noise_um", entry.head_noise_um),
    ] {
        require_not_negative(at(key), value)?;
    }
    require_finite(at("plate_scale_um_per_m"), entry.plate_scale_um_per_m)?;
    require_finite(at("plate_squareness_urad"), entry.plate_squareness_urad)?;
    Ok(())
}
