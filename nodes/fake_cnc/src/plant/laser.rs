//! The laser interferometer that stands in for a length reference.
//!
//! ```text
//!   l = d . (p - p_0),  d = beam's true direction                                         (1)
//!   count = (dead + l) (1 + epsilon(t)) + noise,   epsilon = epsilon_0 + rate t             (2)
//!   reading = count - count at zero                                                       (3)
//! ```
//!
//! p is the reflector on the tool, p_0 its nominal place at the beam's beginning. The true direction
//! differs from the nominal one by a small turn drawn at each mounting: the cosine of it shortens readings, its
//! sine lets motions across the beam in. A wavelength that drifts stretches dead path and measured path
//! alike, and with the dead path shifts the zero. Once the beam is lost there is no reading until the
//! count is set to zero again.

use machine::file::{BeamEntry, LengthReferenceEntry};
use metrology::Axis;
use nalgebra::{Point3, Rotation3, Unit, Vector3};

use super::chain::Rigid;
use super::error::{PlantError, require_finite, require_not_negative, require_positive};
use super::file::LaserEntry;
use super::noise::{Effect, Stream};
use super::structure::{Standing, Structure};

/// What the length reference reads, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LengthReading {
    /// The axis along which the beam advances most.
    pub axis: Axis,
    /// Displacement along the beam.
    pub displacement_mm: f64,
    /// Counts zeroings since the start.
    pub zero_id: u32,
}

#[derive(Clone, Debug)]
pub(super) struct Laser {
    beams: Vec<BeamEntry>,
    resolution_mm: f64,
    entry: LaserEntry,
    mounting: Stream,
    detector: Stream,
    mounted: Option<Mounted>,
    zero_id: u32,
}

#[derive(Clone, Copy, Debug)]
struct Mounted {
    index: usize,
    direction: Vector3<f64>,
    zero_mm: Option<f64>,
}

impl Laser {
    pub(super) fn new(
        machine: &LengthReferenceEntry,
        entry: &LaserEntry,
        seed: u64,
    ) -> Result<Self, PlantError> {
        check(entry)?;
        require_positive("length_reference.resolution_um", machine.resolution_um)?;
        Ok(Self {
            beams: machine.beams.clone(),
            resolution_mm: machine.resolution_um / 1e3,
            entry: entry.clone(),
            mounting: Stream::new(seed, Effect::Laser, 0),
            detector: Stream::new(seed, Effect::Laser, 1),
            mounted: None,
            zero_id: 0,
        })
    }

    pub(super) fn has(&self, id: &str) -> bool {
        self.beams.iter().any(|beam| beam.id == id)
    }

    /// Puts the laser up along the beam `id`, not zeroed.
    pub(super) fn mount(&mut self, id: &str) {
        let found = self.beams.iter().position(|beam| beam.id == id);
        let Some((index, beam)) = found.and_then(|index| Some((index, self.beams.get(index)?)))
        else {
            return;
        };
        let turn = Vector3::from_fn(|_, _| self.mounting.normal()) * self.entry.misalignment_urad;
        let along = Unit::new_normalize(beam.direction());
        // A turn about the beam itself does nothing.
        let across = turn / 1e6 - along.as_ref() * (turn.dot(&along) / 1e6);
        self.mounted = Some(Mounted {
            index,
            direction: Rotation3::new(across) * along.as_ref(),
            zero_mm: None,
        });
    }

    pub(super) const fn is_mounted(&self) -> bool {
        self.mounted.is_some()
    }

    /// Sets the count to zero where the reflector is.
    pub(super) fn zero(&mut self, tool: &Rigid, structure: &Structure, elapsed_s: f64) {
        self.zero_id += 1;
        let count = self.count_mm(tool, structure, elapsed_s);
        if let Some(mounted) = &mut self.mounted {
            mounted.zero_mm = count;
        }
    }

    /// (3), quantised; `None` where there is no count.
    pub(super) fn read(
        &mut self,
        tool: &Rigid,
        structure: &Structure,
        elapsed_s: f64,
    ) -> Option<LengthReading> {
        let zero_mm = self.mounted?.zero_mm?;
        let Some(count_mm) = self.count_mm(tool, structure, elapsed_s) else {
            if let Some(mounted) = &mut self.mounted {
                mounted.zero_mm = None;
            }
            return None;
        };
        let beam = self.beams.get(self.mounted?.index)?;
        Some(LengthReading {
            axis: beam.main_axis(),
            displacement_mm: super::quantised(count_mm - zero_mm, self.resolution_mm),
            zero_id: self.zero_id,
        })
    }

    /// (2); `None` where the beam is lost.
    fn count_mm(&mut self, tool: &Rigid, structure: &Structure, elapsed_s: f64) -> Option<f64> {
        let mounted = self.mounted.as_ref()?;
        let beam = self.beams.get(mounted.index)?;
        let offset_mm = Vector3::from(beam.tool_offset_mm);
        let begin_mm = Vector3::from(beam.from_mm) + offset_mm;
        let begin_mm = begin_mm + structure.on_table_mm(&begin_mm, Standing::Artefact);
        let reflector = tool * Point3::from(offset_mm);
        let way_mm = reflector.coords - begin_mm;
        let along_mm = mounted.direction.dot(&way_mm);
        let across_mm = (way_mm - mounted.direction * along_mm).norm();
        let noise_mm = self.detector.normal() * self.entry.noise_um / 1e3;
        let ppm = self.entry.wavelength_error_ppm
            + self.entry.wavelength_drift_ppm_per_h * elapsed_s / 3600.0;
        (across_mm <= self.entry.beam_radius_mm)
            .then_some((self.entry.dead_path_mm + along_mm) * (1.0 + ppm / 1e6) + noise_mm)
    }
}

fn check(entry: &LaserEntry) -> Result<(), PlantError> {
    let at = |key: &str| format!("length_reference.{key}");
    require_not_negative(at("dead_path_mm"), entry.dead_path_mm)?;
    require_finite(at("wavelength_error_ppm"), entry.wavelength_error_ppm)?;
    require_finite(
        at("wavelength_drift_ppm_per_h"),
        entry.wavelength_drift_ppm_per_h,
    )?;
    require_not_negative(at("misalignment_urad"), entry.misalignment_urad)?;
    require_not_negative(at("noise_um"), entry.noise_um)?;
    require_positive(at("beam_radius_mm"), entry.beam_radius_mm)
}
